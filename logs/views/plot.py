"""Plots a recording."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .run_figure import Scene


def plot(recording: Path, output: Path, scenes: "Sequence[Scene]" = ()) -> None:
    """Draw commanded joints, frames, tree and lifecycle over the time since the goal.

    Runs without a frame, canceled runs and cut recordings can be drawn, too.

    Args:
        recording: The recording, finished or not.
        output: File to write or overwrite; its suffix gives the format. The figure is as wide as
            two columns of a paper.
        scenes: Motions in space, drawn below the rest.

    Raises:
        RecordingError: The recording cannot be read.
        OSError: The file cannot be written.
    """
    from .run_figure import draw  # here, because matplotlib takes 0.5 s to import
    from .timeline import timeline

    draw(timeline(recording), output, scenes)
