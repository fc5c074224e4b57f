"""A drawing as a file."""

from io import BytesIO
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from logs.errors import RecordingError
from logs.records.file_format import MAGIC

_FEWEST_DEGREES = 10.0


def save(figure: Figure, output: Path) -> None:
    """Writes a drawing at once: into a pipe too, which cannot be sought in.

    Args:
        figure: The drawing.
        output: Where to; its suffix says what it is written as, without one PNG.

    Raises:
        RecordingError: A recording is there, which no drawing replaces.
        OSError: It cannot be written.
    """
    if output.is_file():
        with output.open("rb") as there:
            if there.read(len(MAGIC)) == MAGIC:
                raise RecordingError(output, "is a recording; name another file for the drawing")
    FigureCanvasAgg(figure)
    picture = BytesIO()
    figure.savefig(picture, format=output.suffix.lower()[1:] or "png")
    output.write_bytes(picture.getvalue())


def widen(panel: Axes) -> None:
    """Gives joints at rest some room around them, for they are no noise, blown up."""
    low, high = panel.get_ylim()
    room = max(0.0, _FEWEST_DEGREES - (high - low)) / 2
    panel.set_ylim(low - room, high + room)
