"""The picture of a planned task: joints over time, the tree, and the arm from two sides."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from executive.api.events import Event
from executive.api.outcome import GoalStatus
from executive.preview.motion_drawing import scenes_in
from hardware import Robot
from logs.records.records import RunRecord
from logs.views.run_figure import draw
from logs.views.timeline import timeline_of

_DPI = 140  # largest size, because models scale larger pictures down


def picture(events: Sequence[Event], robot: Robot | None) -> bytes:
    """Return a picture of a planned run, as PNG.

    Args:
        events: Events of the planned task.
        robot: Description of the robot; None to leave out the drawings of the arm.
    """
    records, end = [each for each in events if isinstance(each, RunRecord)], events[-1]
    assert isinstance(end, GoalStatus)
    assert end.outcome
    result = end.outcome.to_record(end.identity, max(record.time for record in records))
    records.append(replace(result, state="PLANNED") if result.success else result)
    scenes = scenes_in(records, robot) if robot else []
    with tempfile.TemporaryDirectory() as folder:
        draw(timeline_of(records), output := Path(folder) / "plan.png", scenes, _DPI)
        return output.read_bytes()
