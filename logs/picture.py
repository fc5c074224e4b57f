"""A drawing as a file."""

from io import BytesIO
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def save(figure: Figure, output: Path) -> None:
    """Writes a drawing as PNG, at once: into a pipe too, which cannot be sought in.

    Raises:
        OSError: It cannot be written.
    """
    FigureCanvasAgg(figure)
    picture = BytesIO()
    figure.savefig(picture, format="png")
    output.write_bytes(picture.getvalue())
