"""What the live view shows of real runs, as text: `tests/data/live_view.txt`."""

import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

import logs
from executive.api.events import Where
from executive.cli.terminal.live.live_view import Picture
from executive.cli.terminal.live.run_state import RunState
from executive.testing import SimulatedArm
from hardware import Robot, State, load_robot
from tests.support.paths import DATA, EXAMPLES

TARGET = DATA / "live_view.txt"
TALL = """task: 9
name: tall
description: Say much, move, say much, fail.
tree:
  sequence:
{before}
    - selector:
        - Fail: {{reason: not here}}
        - subtree: move_joints
          with: {{joints: {{joint_1: 20 deg}}}}
{after}
    - Fail: {{reason: the box is not there}}
"""
_SIZES = ((60, 12), (80, 24), (120, 30), (200, 50))
_PLANNED = re.compile(r"found in [\d.]+ ms")


def events(task: int, trees: Path) -> list[logs.Record]:
    """Return the events of a run in simulated time, without the time that planning took."""
    with SimulatedArm(trees=trees) as arm:
        arm.run(task)
        return [_steady(record) for record in arm.records]


def _steady(record: logs.Record) -> logs.Record:
    if isinstance(record, logs.NodeStatus):
        return replace(record, message=_PLANNED.sub("found in 2.0 ms", record.message))
    return record


def picture(
    records: Sequence[logs.Record], moment: int, size: tuple[int, int], robot: Robot, later: float
) -> str:
    """Return the picture when a number of events has arrived.

    Args:
        records: Events of a run.
        moment: How many of them have arrived.
        size: Columns and rows of the terminal.
        robot: The robot.
        later: Time since the last of these events [s].
    """
    state = RunState(Where.of(robot, State.UNCONFIGURED, None))
    for record in records[:moment]:
        state = state.begun(record) if isinstance(record, logs.Goal) else state
        state.update(record)
    return drawn(Picture(state, records[moment - 1].time + later), size)


def drawn(what: Picture, size: tuple[int, int]) -> str:
    """Return a picture as text, in a terminal of a number of columns and rows."""
    out = io.StringIO()
    Console(file=out, width=size[0], height=size[1], color_system=None).print(what)
    return out.getvalue()


def _moment(records: Sequence[logs.Record], reached: Callable[[logs.Record], bool]) -> int:
    return next(k for k, record in enumerate(records) if reached(record)) + 1


def _frame(records: Sequence[logs.Record], number: int) -> int:
    """Return how many events have arrived with a frame; the first has the number 1."""
    sent = [k for k, record in enumerate(records) if isinstance(record, logs.Sent)]
    return sent[number - 1] + 1


def _pictures() -> Iterator[tuple[str, str]]:
    robot = load_robot(None)
    with TemporaryDirectory() as folder:
        say = "    - Say: {text: a word}\n"
        tall = TALL.format(before=30 * say, after=30 * say)
        Path(folder, "9_tall.yaml").write_text(tall)
        runs = {1: events(1, EXAMPLES), 4: events(4, EXAMPLES), 9: events(9, Path(folder))}
    boots = _moment(runs[1], lambda r: isinstance(r, logs.Transition) and r.goal == "activating")
    moments = (
        ("the board boots", 1, boots, 0.75),
        ("in the middle of the motion", 1, _frame(runs[1], 16), 0.02),
        ("done", 1, len(runs[1]), 0.0),
        ("in the third of six motions", 4, _frame(runs[4], 60), 0.02),
        ("in the middle of a tall tree", 9, _frame(runs[9], 5), 0.02),
        ("a tall tree that failed", 9, len(runs[9]), 0.0),
    )
    for what, task, moment, later in moments:
        for size in _SIZES:
            title = f"task {task}, {what}, {size[0]} columns, {size[1]} rows"
            yield title, picture(runs[task], moment, size, robot, later)


def pictures() -> str:
    """Return all pictures as one text."""
    return "\n".join(f"==== {title}\n{text}" for title, text in _pictures())


if __name__ == "__main__":
    TARGET.write_text(pictures())
