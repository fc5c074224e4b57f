"""How soon a run goes on, how soon it stops, and what it leaves behind.

`next_skill` and the idle server run on the virtual Arduino in real time; a cancel is timed at the
bytes of a pseudo-terminal, by another process that reads them. Ten thousand cancels and a thousand
goals run in simulated time, on the board in-process. `cancel_http` is the same cancel asked by a
request, `stop_in_flood` a stop on a new connection while strangers, in another process, send all
they can. `rosbridge_result` is an empty task asked as roslibpy does, by a client in this process,
at once after the one before, as the peers' was; `rosbridge_paused` once its recording is finished.
"""

import dataclasses
import json
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

# A file beside this one is named like a room, and this folder comes first when run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

from py_trees.common import Status

import executive.goals.executor
import logs
from executive.api import Policy
from executive.api.events import Event
from executive.api.outcome import GoalState
from executive.executive import Executive
from executive.goals.run_loop import Run
from executive.setup import Setup
from hardware import (
    VIRTUAL,
    BoardLink,
    Clock,
    Link,
    RealClock,
    Robot,
    SimulatedClock,
    load_robot,
)
from hardware.drivers.arduino.firmware_profile import ARMTREE, FIRMWARES
from hardware.drivers.arduino.virtual.board import Board
from skills import Cancel, Skill, skill
from skills.motion import Pool
from tests.bench.table import Row, arguments, show
from tests.support.arms.virtual_boards import virtual_board
from tests.support.recordings.finished import at_rest, finished, rest, sweep
from tests.support.resources import descriptors_used, memory_used, threads_used
from tests.support.servers.network_ports import in_a_flood, over_http, rosbridge_results, served
from trees.live_library import LiveLibrary

Way = Callable[[Executive], AbstractContextManager[Callable[[], object]]]

EMPTY = "task: 20\nname: empty\ndescription: Nothing.\ntree: Succeed\n"
SWING = """\
task: {number}
name: swing{number}
description: A swing that changes every frame.
tree:
  subtree: reach
  with:
    arm: {{joint_1: {angle}, joint_2: 0.2, joint_3: -0.2}}
    gripper: {{joint_4: 0}}
"""
MARKS = 100
CHAIN = (
    "task: 23\nname: chain\ndescription: Work, and what follows it.\ntree:\n  sequence:\n"
    + "    - bench_work\n    - BenchMark\n" * MARKS
)

# Reads a pseudo-terminal in a process of its own; asked for it, tells what came when since it was
# asked last.
LISTENER = """
import json, os, pty, select, sys, time, tty
master, slave = pty.openpty()
tty.setraw(slave)
print(os.ttyname(slave), flush=True)
came = []
while True:
    ready, _, _ = select.select([master, sys.stdin], [], [])
    if master in ready:
        data = os.read(master, 4096)
        came.append((time.monotonic(), data.decode()))
    elif not sys.stdin.readline():
        break
    else:
        print(json.dumps(came), flush=True)
        came = []
"""

_ended: list[float] = []
_began: list[float] = []


@skill
def bench_work(cancel: Cancel) -> None:
    """Take two milliseconds."""
    cancel.wait(0.002)
    _ended.append(time.monotonic())


class BenchMark(Skill):
    """Note when it begins."""

    INPUT_PORTS: dict[str, Any] = {}
    OUTPUT_PORTS: dict[str, Any] = {}

    def on_start(self) -> Status:
        """Note it."""
        _began.append(time.monotonic())
        return Status.SUCCESS


class Ears:
    """Hears all that an executive tells."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.events: list[Event] = []

    def __call__(self, event: Event) -> None:
        with self.changed:
            self.events.append(event)
            self.changed.notify_all()

    def wait_for_frames(self, number: int) -> None:
        """Wait until so many frames were sent since the events were cleared."""

        def sent() -> bool:
            return sum(isinstance(event, logs.Sent) for event in self.events) >= number

        with self.changed:
            assert self.changed.wait_for(sent, timeout=60)


@contextmanager
def serving(
    robot: Robot, link: Link, clock: Clock, ears: Callable[[Event], None], folder: Path
) -> Iterator[Executive]:
    """An executive with an active arm."""
    tasks = folder / "tasks"
    tasks.mkdir(exist_ok=True)
    (tasks / "20_empty.yaml").write_text(EMPTY)
    (tasks / "21_swing21.yaml").write_text(SWING.format(number=21, angle=1.4))
    (tasks / "22_swing22.yaml").write_text(SWING.format(number=22, angle=-1.4))
    (tasks / "23_chain.yaml").write_text(CHAIN)
    library = LiveLibrary(tasks, robot)
    with closing(Pool(robot, 1, clock)) as pool:
        setup = Setup(recordings=folder, policy=Policy.QUEUE)
        made = Executive(setup, robot, link, library, pool, clock)
        made.subscribe(ears)
        made.start()
        made.arm_to("configure")
        made.arm_to("activate")
        yield made
        made.close()


def quick_robot() -> Robot:
    """The shipped robot with our firmware, which says when it has booted."""
    robot = load_robot()
    serial = dataclasses.replace(robot.serial, boot_wait=5.0)
    return dataclasses.replace(robot, serial=serial, firmware=FIRMWARES["armtree"])


def next_skill_times() -> list[float]:
    """From the end of a worker's job to the start of the skill after it [ms]."""
    robot = quick_robot()
    with tempfile.TemporaryDirectory() as folder:
        link = robot.link(VIRTUAL)
        with serving(robot, link, RealClock(), Ears(), Path(folder)) as arm:
            for _ in range(3):
                arm.result(arm.send(23).identity)
    return [(b - a) * 1000 for a, b in zip(_ended, _began, strict=True)][MARKS:]


@contextmanager
def directly(arm: Executive) -> Iterator[Callable[[], object]]:
    """What cancels all goals, in this process."""
    yield arm.cancel


def cancel_times(count: int, way: Way = directly) -> list[float]:
    """From a cancel to the hold frame at the other end, streaming at full rate [ms]."""
    robot, rng, times = quick_robot(), random.Random(1), list[float]()
    silent = dataclasses.replace(ARMTREE, banner=b"")  # no board answers on that line
    serial = dataclasses.replace(robot.serial, boot_wait=0.1)
    robot = dataclasses.replace(
        robot, firmware=dataclasses.replace(silent, boot_time=0.0), serial=serial
    )
    command, pipe = [sys.executable, "-c", LISTENER], subprocess.PIPE
    with (
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as listener,
        tempfile.TemporaryDirectory() as folder,
    ):
        assert listener.stdout
        assert listener.stdin
        ears, clock = Ears(), RealClock()
        link = robot.link(listener.stdout.readline().strip())
        with (
            serving(robot, link, clock, ears, Path(folder)) as arm,
            way(arm) as cancel,
        ):
            for number in range(count):
                ears.events.clear()
                goal = arm.send(21 + number % 2).identity
                ears.wait_for_frames(rng.randint(4, 12))
                rest(clock, rng.uniform(0.0, 0.02))
                begun = time.monotonic()
                cancel()
                assert arm.result(goal).state is GoalState.CANCELED
                listener.stdin.write("\n")
                listener.stdin.flush()
                heard = json.loads(listener.stdout.readline())
                frames = _frames("".join(data for _, data in heard))
                assert frames[-1] == frames[-2], "the last frame is not a hold"
                times.append((heard[-1][0] - begun) * 1000)
        listener.stdin.close()
    return times


def _frames(data: str) -> list[str]:
    return [data[i : i + 20] for i in range(0, len(data), 20)]


class _NotedRun(Run):
    """A run whose tree can be looked at when it is over."""

    trees: list[Any] = []

    def __init__(self, goal: Any, tree: Any, *rest: Any) -> None:
        super().__init__(goal, tree, *rest)
        self.trees[:] = [tree]


class _TappedLink(BoardLink[Board]):
    """A link that keeps what is written to it."""

    written = 0

    def write(self, data: bytes) -> None:
        """Write a frame."""
        super().write(data)
        self.written += 1


def leftovers(cancels: int) -> tuple[int, int, int]:
    """Cancels at random instants: nodes or work left alive, frames after a hold, and holds.

    Frames after a hold are searched for until long after the result, reported or written.
    """
    clock, robot, rng = SimulatedClock(), load_robot(), random.Random(1)
    zombies = after_hold = stopped = 0
    setattr(executive.goals.executor, "Run", _NotedRun)  # noqa: B010, for the time being
    with tempfile.TemporaryDirectory() as folder, clock.working():
        link, sent = _TappedLink(virtual_board(robot), clock), list[logs.Sent]()

        def watch(event: Event) -> None:
            if isinstance(event, logs.Sent):
                sent.append(event)

        with serving(robot, link, clock, watch, Path(folder)) as arm:
            for number in range(cancels):
                sent.clear()
                written = link.written
                goal = arm.send(21 + number % 2).identity
                rest(clock, rng.choice((0.0, *(rng.uniform(0.0, 3.0) for _ in range(9)))))
                arm.cancel(rng.choice(("", goal)))
                arm.result(goal)
                rest(clock, 0.3)
                for tree in _NotedRun.trees:
                    zombies += sum(s.status is Status.RUNNING or s.busy for s in tree.skills)
                    zombies += sum(node.status is Status.RUNNING for node in tree.root.iterate())
                holds = [i for i, frame in enumerate(sent) if frame.hold]
                frames = max(len(sent), link.written - written)
                after_hold += frames - 1 - holds[0] if holds else 0
                stopped += bool(holds)
                _NotedRun.trees.clear()
                sweep(Path(folder))
    setattr(executive.goals.executor, "Run", Run)  # noqa: B010
    return zombies, after_hold, stopped


def soak(goals: int) -> tuple[int, float, int, int]:
    """Goals back to back: how many succeeded, and how memory, threads and descriptors grew."""
    clock, robot, done = SimulatedClock(), load_robot(), 0
    with tempfile.TemporaryDirectory() as folder, clock.working():
        link = BoardLink(virtual_board(robot), clock)
        with serving(robot, link, clock, lambda _: None, Path(folder)) as arm:
            for number in range(20):  # what is loaded once is loaded
                arm.result(arm.send(21 + number % 2).identity)
            at_rest(Path(folder))
            memory, threads, descriptors = memory_used(), threads_used(), descriptors_used()
            for number in range(goals):
                done += arm.result(arm.send(21 + number % 2).identity).success
                if number % 50 == 0:
                    sweep(Path(folder))
            grown = memory_used() - memory
            at_rest(Path(folder))
            rest(clock, 1.0)
            return done, grown, threads_used() - threads, descriptors_used() - descriptors


def idle_load(seconds: float) -> float:
    """What a server takes of a core while it waits for a goal [%]."""
    robot, clock = quick_robot(), RealClock()
    with tempfile.TemporaryDirectory() as folder:
        link = robot.link(VIRTUAL)
        with (
            serving(robot, link, clock, lambda _: None, Path(folder)) as arm,
            served(arm),
        ):
            arm.result(arm.send(20).identity)
            rest(clock, 2.0)
            used = time.process_time()
            rest(clock, seconds)
            return 100 * (time.process_time() - used) / seconds


def bridge(count: int, apart: bool) -> float:
    """The median from an empty task's goal to its result, asked by rosbridge [ms].

    Args:
        count: How many goals.
        apart: Whether each waits until the recording of the one before is finished.
    """
    robot = quick_robot()
    with tempfile.TemporaryDirectory() as folder:
        link = robot.link(VIRTUAL)
        with (
            serving(robot, link, RealClock(), lambda _: None, Path(folder)) as arm,
            served(arm) as server,
        ):
            between = partial(finished, Path(folder)) if apart else lambda: None
            rosbridge_results(server, 20, 3, between)
            return statistics.median(rosbridge_results(server, 20, count, between))


def percentile(samples: Sequence[float], percent: int) -> float:
    return statistics.quantiles(samples, n=100)[percent - 1]


def main(runs: int, file: Path | None, cancels: int) -> None:
    """Measure and show."""
    following, canceled = next_skill_times(), cancel_times(200)
    asked = cancel_times(200, over_http)
    flooded = cancel_times(100, in_a_flood)
    zombies, after_hold, stopped = leftovers(cancels)
    done, grown, threads, descriptors = soak(1000)
    rows = [
        Row("next_skill_p95_ms", "ms", [percentile(following, 95)]),
        Row("cancel_p50_ms", "ms", [percentile(canceled, 50)]),
        Row("cancel_p99_ms", "ms", [percentile(canceled, 99)]),
        Row("cancel_http_p50_ms", "ms", [percentile(asked, 50)]),
        Row("cancel_http_p99_ms", "ms", [percentile(asked, 99)]),
        Row("stop_in_flood_p50_ms", "ms", [percentile(flooded, 50)]),
        Row("stop_in_flood_p99_ms", "ms", [percentile(flooded, 99)]),
        Row("rosbridge_result_p50_ms", "ms", [bridge(100, False) for _ in range(runs)]),
        Row("rosbridge_paused_p50_ms", "ms", [bridge(100, True) for _ in range(runs)]),
        Row("zombies", "1", [zombies]),
        Row("frames_after_hold", "1", [after_hold]),
        Row("cancels_in_motion", "1", [stopped]),
        Row("goals_done", "1", [done]),
        Row("memory_growth_mib", "MiB", [grown]),
        Row("threads_growth", "1", [threads]),
        Row("descriptors_growth", "1", [descriptors]),
        Row("idle_cpu_percent", "%", [idle_load(5.0) for _ in range(min(runs, 3))]),
    ]
    show(rows, file)


if __name__ == "__main__":
    parser = arguments(__doc__ or "")
    parser.add_argument("--cancels", type=int, default=10_000, help="at random instants")
    given = parser.parse_args()
    main(given.runs, given.json, given.cancels)
