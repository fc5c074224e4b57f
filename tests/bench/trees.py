"""How long task files take, however many there are and however large.

`load_10k_s`: 10 000 task files like those that ship, listed. `load_10k_parameters_s`: the same,
when each declares a parameter. `find_one_s`: one of them, found and built, ready to run.
`check_1000_nodes_s`: a file of a thousand nodes, read and checked. `tick_ratio`: a tree of a
thousand waiting skills ticked by the run loop, over the same tree ticked by py_trees alone.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

# Python puts a script's folder first, where this file would pass for the room of its name.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

from executive.api import Policy
from executive.goals.goal import Goal
from executive.goals.mailbox import Mailbox
from executive.goals.queue import GoalQueue
from executive.goals.run_loop import Run
from executive.goals.stop import GoalStopper
from hardware import Arm, RealClock, Robot, load_robot
from skills import Context
from skills.motion import Pool
from tests.bench.table import Row, arguments, show
from trees import Library
from trees.analysis.unreachable_nodes import check_outcomes
from trees.build import build
from trees.compile.compiler import TreeCompiler

FILES = 10_000
NODES = 1000
TICKS = 200

TASK = """\
task: {number}
name: task{number}
description: One of very many.
{parameters}tree:
  sequence:
    - subtree: reach
      with: {{arm: upright, gripper: open}}
    - subtree: move_joints
      with: {{joints: {{joint_1: {swing}}}}}
"""
PARAMETERS = """\
parameters:
  swing: {type: angle, default: 20 deg, min: 1 deg, max: 60 deg, description: how far}
"""


def timed(act: Callable[[], object]) -> float:
    """How long something takes [s]."""
    begun = time.perf_counter()
    act()
    return time.perf_counter() - begun


def nothing(*_: object) -> None:
    """Watches nothing."""


class Bench:
    """A folder of very many tasks, and a context without an arm that moves."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        self.folder = folder
        self.clock = RealClock()
        self.arm = Arm(robot, None, self.clock)
        self.mailbox = Mailbox(self.clock)
        pool = Pool(robot, 1, self.clock)
        self.context = Context(
            robot,
            self.arm,
            pool,
            1,
            5.0,
            self.mailbox.wake,
            nothing,
            self.clock,
            self.mailbox.wake_at,
        )
        self.many, self.large = folder / "many", folder / "large"
        for made in (self.many, self.large):
            made.mkdir()
        self.write("", "20 deg")
        head = "task: 10\nname: large\ndescription: A thousand nodes.\ntree:\n  "
        compares = '    - Compare: {left: 1, is: "<", right: 2}\n' * (NODES - 1)
        (self.large / "10_large.yaml").write_text(f"{head}sequence:\n{compares}")
        waits = "    - Wait: {duration: 1 h}\n" * (NODES - 1)
        text = f"{head}parallel:\n{waits}".replace("10\nname: large", "11\nname: wide", 1)
        (self.large / "11_wide.yaml").write_text(text)

    def write(self, parameters: str, swing: str) -> None:
        """Write the many tasks."""
        for number in range(10, 10 + FILES):
            text = TASK.format(number=number, parameters=parameters, swing=swing)
            (self.many / f"{number}_task{number}.yaml").write_text(text)

    def load(self) -> None:
        """List every task."""
        library = Library(self.many)
        assert len([library.head(number) for number in library.numbers()]) > FILES

    def find(self) -> None:
        """Find one and build it."""
        library = Library(self.many)
        build(library.draft(7777), library, self.context, "bench").discard()

    def check(self) -> None:
        """Read and check a thousand nodes."""
        library = Library(self.large)
        tree = TreeCompiler(library.draft(10), library, self.context, "/bench").compile()
        check_outcomes(tree)
        assert not tree.mistakes.found

    def tick_ratio(self) -> float:
        """The run loop's ticks over bare ones; both trees have their first tick behind them."""
        library = Library(self.large)
        bare = build(library.draft(11), library, self.context, "bare")
        bare.root.tick_once()
        plain = timed(lambda: tick(bare.root))
        bare.discard()
        ours = build(library.draft(11), library, self.context, "ours")
        loop = timed_loop(Run(*self._run(ours)), ours.root, self.mailbox)
        ours.discard()
        return loop / plain

    def _run(self, tree: Any) -> tuple[Any, ...]:
        goal = Goal("0" * 32, 11, {}, self.clock.now(), 1, self.mailbox)
        queue = GoalQueue(self.clock, Policy.REJECT, 0.0, nothing)
        recordings: Any = None  # no goal ends here
        stopper = GoalStopper(queue, self.arm, recordings, self.clock)
        return goal, tree, self.arm, stopper, self.clock, nothing


def tick(root: Any) -> None:
    """Tick, with nothing around it."""
    for _ in range(TICKS):
        root.tick_once()


class _EnoughError(Exception):
    """Ends the loop."""


def timed_loop(run: Run, root: Any, mailbox: Mailbox) -> float:
    """How long the run loop takes for TICKS ticks after the first [s]."""
    times: list[float] = []
    tick = root.tick_once

    def counted() -> None:
        times.append(time.perf_counter())
        if len(times) > TICKS + 1:
            raise _EnoughError
        tick()
        mailbox.wake()

    root.tick_once = counted
    with suppress(_EnoughError):
        run.execute()
    return times[-1] - times[1]


def main(runs: int, file: Path | None) -> None:
    """Measure and show."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(load_robot(), Path(folder))
        rows = [
            Row("load_10k_s", "s", [timed(bench.load) for _ in range(min(runs, 3))]),
            Row("find_one_s", "s", [timed(bench.find) for _ in range(runs)]),
            Row("check_1000_nodes_s", "s", [timed(bench.check) for _ in range(runs)]),
            Row("tick_ratio", "", [bench.tick_ratio() for _ in range(3 * runs)]),
        ]
        bench.write(PARAMETERS, "$swing")
        with_parameters = [timed(bench.load) for _ in range(min(runs, 3))]
        rows.append(Row("load_10k_parameters_s", "s", with_parameters))
    show(rows, file)


if __name__ == "__main__":
    given = arguments(__doc__ or "").parse_args()
    main(given.runs, given.json)
