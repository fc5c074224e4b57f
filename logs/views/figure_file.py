"""Writes figures to files."""

from io import BytesIO
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from hardware import write_file
from hardware.printable import escaped
from logs.errors import RecordingError
from logs.records.file_format import MAGIC

_LEAST_RANGE = 10.0  # smallest range of the y axis [deg]


def save(figure: Figure, output: Path) -> None:
    """Write a figure to a file or a pipe. All texts in the figure are drawn literally.

    Args:
        figure: The figure.
        output: File to write. Its suffix sets the format; without a suffix, the format is PNG.

    Raises:
        RecordingError: The file exists and is a recording. Recordings are not overwritten.
        OSError: The file cannot be written.
    """
    if output.is_file():
        with output.open("rb") as there:
            if there.read(len(MAGIC)) == MAGIC:
                raise RecordingError(output, "is a recording; name another file for the drawing")
    for text in figure.findobj(Text):  # names in recordings and files may look like formulas
        text.set_parse_math(False)
        text.set_text(escaped(text.get_text()))
    FigureCanvasAgg(figure)
    image = BytesIO()  # savefig seeks, and a pipe cannot seek
    figure.savefig(image, format=output.suffix.lower()[1:] or "png")
    write_file(output, image.getvalue())


def widen(panel: Axes) -> None:
    """Widen the y axis to at least 10 degrees, so small noise does not fill the panel."""
    low, high = panel.get_ylim()
    room = max(0.0, _LEAST_RANGE - (high - low)) / 2
    panel.set_ylim(low - room, high + room)
