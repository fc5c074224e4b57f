"""What tests of several rooms share: one simulated clock and one pool of planners per session."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import pytest
from hypothesis import HealthCheck, settings
from py_trees.blackboard import Blackboard

import logs
from executive.api.events import Event, QuestionStatus
from executive.api.outcome import GoalStatus, Outcome
from executive.cli.support import process
from executive.executive import Executive
from executive.setup import Setup
from executive.task_runner import TaskRunner
from executive.testing import SharedPool
from hardware import Arm, BoardLink, Clock, RealClock, Robot, SimulatedClock, load_robot
from skills import Context, Operator, Skill, SkillEvent
from skills.motion import Plan, Pool, Query, Request, Result
from tests.support.arms.virtual_boards import virtual_board
from trees import Library
from trees.compile.arguments import read_arguments

# Commands that the tests start load compiled files, even if the environment forbids to write them:
# compiling armtree is more than a third of the work of a short command.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Under nohup a hang-up is ignored, in the background of a script Ctrl-C is, by whatever the tests
# start, too; some tests want them to count.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
process.NICE = 0  # a command that runs in the process of the tests leaves their niceness alone
os.environ["XDG_CONFIG_HOME"] = os.devnull  # no settings of the person who runs the tests

# How long an example takes says how busy the machine is.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("quick", settings.get_profile("suite"), max_examples=20)


def pytest_configure(config: pytest.Config) -> None:
    """`make quick` tries fewer examples, except of tests that say how many."""
    settings.load_profile("quick" if config.option.markexpr == "not slow" else "suite")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """What is picked out runs right here, where -s works. The whole suite uses several processes.

    Its tests wait for about half of their time, so one more process than cores makes it a sixth
    shorter.
    """
    whole = all(map(os.path.isdir, config.option.file_or_dir)) and not config.option.keyword
    return len(os.sched_getaffinity(0)) + 1 if whole else 0


R = TypeVar("R")
RigMaker = Callable[..., "Rig"]


class Rig:
    """An executive on the in-process board, and everything that it reported."""

    def __init__(
        self,
        robot: Robot,
        clock: SimulatedClock,
        pool: Pool,
        recordings: Path,
        tasks: Path | None = None,
        operator: Operator | None = None,
        single_user: bool = True,
        **settings: Any,
    ) -> None:
        self.robot, self.clock = robot, clock
        self.link = BoardLink(virtual_board(robot), clock)
        self.records: list[logs.Record] = []
        self.statuses: list[GoalStatus] = []
        self.outcomes: list[Outcome] = []
        self.on_record: Callable[[logs.Record], None] = lambda _: None
        setup = Setup(recordings=recordings, single_user=single_user, **settings)
        self.executive = Executive(setup, robot, self.link, Library(tasks), pool, clock, operator)
        self.executive.subscribe(self._watch)
        self._runner = TaskRunner(self.executive)

    def run(self, *numbers: int, settings: Sequence[str] = ()) -> list[Outcome]:
        """Run tasks in turn on this thread, with parameters as NAME=VALUE."""
        arguments = read_arguments(settings, numbers)
        with self.clock.working():
            return self._runner.run_all(numbers, arguments, self.outcomes.append)

    def cancel(self) -> None:
        """Cancel what runs, and what would follow."""
        self._runner.stop()

    def rest(self, seconds: float) -> None:
        """Let time pass."""
        signal, until = self.clock.signal(), self.clock.now() + seconds
        with signal:
            while self.clock.now() < until:
                signal.wait(until)

    def soon(self, act: Callable[[], None]) -> threading.Thread:
        """Do it on another thread, before time goes on; other threads may go on. Return it."""
        return self.clock.spawn(act, "test")

    def _watch(self, event: Event) -> None:
        if isinstance(event, GoalStatus):
            self.statuses.append(event)
        elif not isinstance(event, QuestionStatus):
            self.records.append(event)
            self.on_record(event)

    def recorded(self, kind: type[R]) -> list[R]:
        """The records of a kind."""
        return [record for record in self.records if isinstance(record, kind)]

    @property
    def frames(self) -> list[str]:
        """Every frame that was sent, holds in brackets."""
        return [
            f"({record.data.decode()})" if record.hold else record.data.decode()
            for record in self.recorded(logs.Sent)
        ]

    @property
    def opened(self) -> int:
        """How often the link was opened."""
        return self.link.board.state(self.clock.now()).resets


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot(None)


@pytest.fixture(scope="session")
def shared_clock() -> SimulatedClock:
    return SimulatedClock()


@pytest.fixture(scope="session")
def shared_pool(robot: Robot, shared_clock: SimulatedClock) -> Iterator[Pool]:
    pool = SharedPool(robot, 1, shared_clock)
    pool.start()
    yield pool
    pool.close()


class KeptPool(SharedPool):
    """A planner that stays for the next one who uses it."""

    def close(self) -> None:
        """Do nothing."""


@pytest.fixture(scope="session", autouse=True)
def own_servers(tmp_path_factory: pytest.TempPathFactory) -> None:
    """No command of a test finds the server of another process, which may hold its arm."""
    os.environ["XDG_RUNTIME_DIR"] = str(tmp_path_factory.mktemp("runtime"))


@pytest.fixture(scope="session", autouse=True)
def planner_of_checks() -> Iterator[None]:
    """All checks of files for the shipped robot use one planner: a new one takes half a second."""
    robot = load_robot(None)
    kept = KeptPool(robot, 1, RealClock())

    def planner(other: Robot, workers: int, clock: Clock) -> Pool:
        return kept if other == robot else Pool(other, workers, clock)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("trees.check.Pool", planner)
        yield
    super(KeptPool, kept).close()


@pytest.fixture
def rig(
    robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool, tmp_path: Path
) -> Iterator[RigMaker]:
    """Makes rigs; when the test ends, none has left anything on the blackboard."""

    def make(
        tasks: Path | None = None,
        pool: Pool = shared_pool,
        robot: Robot = robot,
        recordings: Path = tmp_path,
        **options: Any,
    ) -> Rig:
        return Rig(robot, shared_clock, pool, recordings, tasks, **options)

    yield make
    assert Blackboard.storage == {}
    assert Blackboard.metadata == {}
    assert Blackboard.clients == {}


@pytest.fixture
def server(rig: RigMaker, shared_clock: SimulatedClock) -> Iterator[RigMaker]:
    """Makes rigs that serve others: started, with an active arm, and closed at the end."""
    made: list[Rig] = []

    def make(active: bool = True, **options: Any) -> Rig:
        one = rig(single_user=False, **options)
        made.append(one)
        one.executive.start()
        if active:
            one.executive.arm_to("configure")
            one.executive.arm_to("activate")
        return one

    with shared_clock.working():
        yield make
        for one in made:
            one.executive.close()


class Asked:
    """A job that waits to be answered by the test; a cancel is only noted."""

    def __init__(self, request: Request, done: Callable[[Result], None]) -> None:
        self.request, self.canceled = request, 0
        self._done = done

    def cancel(self) -> None:
        self.canceled += 1

    def answer(self, result: Result) -> None:
        self._done(result)


class Desk:
    """Takes the place of the pool, for tests that decide when which job is answered how."""

    def __init__(self) -> None:
        self.jobs: list[Asked] = []

    def submit(self, request: Request, done: Callable[[Result], None]) -> Asked:
        self.jobs.append(Asked(request, done))
        return self.jobs[-1]


class Bench:
    """An active arm on the in-process board, and single skills to try on it."""

    def __init__(self, robot: Robot, clock: SimulatedClock, pool: Pool | None = None) -> None:
        self.robot, self.clock, self.desk = robot, clock, Desk()
        self.link = BoardLink(virtual_board(robot), clock)
        self.events: list[Any] = []
        self.reported: list[SkillEvent] = []
        self.wakes = 0
        self.deadlines: list[float] = []
        self.arm = Arm(robot, self.link, clock, self.events.append)
        self._signal = clock.signal()
        self.context = Context(
            robot,
            self.arm,
            pool or cast("Pool", self.desk),
            1,
            5.0,
            self._wake,
            self.reported.append,
            clock,
            self.deadlines.append,
        )

    def skill(self, kind: type[Skill], **inputs: object) -> Any:
        """A skill with these inputs, all ports wired to keys of their names."""
        skill = kind(kind.__name__, self.context)
        ports = {**kind.input_ports(), **kind.output_ports()}
        skill.setup_ports({port: f"/bench/{port}" for port in ports}, "/bench")
        for port, value in inputs.items():
            Blackboard.set(f"/bench/{port}", value)
        return skill

    def output(self, port: str) -> Any:
        """What a skill wrote."""
        return Blackboard.get(f"/bench/{port}")

    def wait(self) -> None:
        """Wait for the next wake-up."""
        with self._signal:
            seen = self.wakes
            while self.wakes == seen:
                self._signal.wait(None)

    def _wake(self) -> None:
        with self._signal:
            self.wakes += 1
            self._signal.notify()


@pytest.fixture
def bench(robot: Robot, shared_clock: SimulatedClock) -> Iterator[Bench]:
    made = Bench(robot, shared_clock)
    with shared_clock.working(), made.arm:
        made.arm.configure()
        made.arm.activate()
        yield made
    Blackboard.clear()
    Blackboard.metadata.clear()
    Blackboard.clients.clear()


@pytest.fixture(scope="session")
def plans(robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool) -> tuple[Plan, Plan]:
    """A plan for the arm and one for the gripper, from the boot pose."""
    found: list[Result] = []
    signal = shared_clock.signal()

    def done(result: Result) -> None:
        with signal:
            found.append(result)
            signal.notify()

    with shared_clock.working():
        shared_pool.submit(Query("arm", (0.0,) * 4, (0.3, 0.0, 0.0)), done)
        shared_pool.submit(Query("gripper", (0.3, 0.0, 0.0, 0.0), (-0.2,)), done)
        with signal:
            while len(found) < 2:
                signal.wait(None)
    arm, gripper = found
    assert isinstance(arm, Plan)
    assert isinstance(gripper, Plan)
    return arm, gripper


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """`armtree plan` draws nothing, which takes it a second: for tests of its words."""
    monkeypatch.setattr("executive.preview.explanation._draw", lambda *_: None)


@pytest.fixture
def picked(tmp_path: Path, rig: RigMaker) -> Path:
    """A recording of task 1."""
    (outcome,) = rig().run(1)
    folder = tmp_path / "runs"
    folder.mkdir()
    return Path(outcome.recording).rename(folder / "pick.mcap")
