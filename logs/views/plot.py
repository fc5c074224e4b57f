"""A run on paper."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .run_figure import Scene


def plot(recording: Path, output: Path, scenes: "Sequence[Scene]" = ()) -> None:
    """Draws a run: commanded joints, frames, tree and lifecycle over the time since the goal.

    Works for runs without a frame, for canceled ones, and for recordings that were cut off.

    Args:
        recording: The recording, or a journal.
        output: The file to write, two columns of a paper wide; replaced where it exists.
        scenes: Motions in space, drawn below all that.

    Raises:
        RecordingError: The recording cannot be read.
        OSError: The file cannot be written.
    """
    from .run_figure import draw  # here, for matplotlib takes half a second to import
    from .timeline import timeline

    draw(timeline(recording), output, scenes)
