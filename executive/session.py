"""Makes an executive from a set-up, for the command line, the server, tests and users."""

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import logs
from hardware import VIRTUAL, Clock, Link, LinkError, RealClock, Robot, utc_ns
from logs.writing.retention import Rule, prune
from skills import Leader, Operator
from skills.motion import EMPTY, BadWorld, Pool, Verify, World
from skills.user_skills import load_skills
from trees import Library, TaskLibrary
from trees.nodes.kind import reserved_names

from .api.events import Event
from .executive import Executive
from .host_limits import check_host
from .setup import Setup

logger = logging.getLogger(__name__)


@contextmanager
def open_executive(
    setup: Setup,
    *,
    clock: Clock | None = None,
    link: Link | None = None,
    pool: Pool | None = None,
    operator: Operator | None = None,
    leader: Leader | None = None,
    subscriber: Callable[[Event], None] | None = None,
    report: Callable[[str], None] = logger.warning,
) -> Iterator[Executive]:
    """Make the executive of a set-up. Close it and its planners at the end of the context.

    First recover incomplete recordings, and delete old ones. The caller starts the executive.

    Args:
        setup: The set-up.
        clock: Time source. Default: real time.
        link: Link to the board. Default: the link of the set-up's port.
        pool: Planners, which the caller closes. Default: new planners, closed at the end.
        operator: Answers the questions of tasks. Default: no operator.
        leader: Hand-guided arm, for tasks that follow it. Default: none.
        subscriber: Callback for every event, from any thread.
        report: Callback for messages: one about each recovered or deleted recording, and one if a
            server cannot open its port yet.

    Raises:
        HostLimit: The operating system lets this process open too few files.
        HardwareError: The robot file is wrong or names no driver, or the start pose is not
            confirmed. For a single user also: the port does not exist or is not permitted.
        TreeError: The folder of tasks cannot be read.
        BadWorldFile: The world file is wrong or missing.
        LogError: A recording could not be finished at the end.
    """
    check_host(setup.workers)
    robot, clock = setup.load_robot(), clock or RealClock()
    port = robot.serial.port if setup.port is None else setup.port
    with ExitStack() as stack:
        if link is None and port:
            link = robot.link(port)
            if setup.single_user and port == VIRTUAL:
                _switch_on(link, stack)
        library = _library(setup, robot)
        early = list(_tidy(setup, clock))
        for line in early:
            report(line.message)
        if pool is None:
            pool = Pool(robot, setup.workers, clock)
            stack.enter_context(closing(pool))
        world = _load_world(setup.world, robot, pool) if setup.world else EMPTY
        executive = Executive(setup, robot, link, library, pool, clock, operator, leader, world)
        if subscriber:
            executive.subscribe(subscriber)
        for line in early:
            executive.record(line)
        with closing(executive):
            if setup.single_user or setup.activate or setup.pose:
                executive.start_pose.find()  # checked before the port is opened
            if port != VIRTUAL and (setup.single_user or not setup.activate):
                _check_port(setup, link, report)
            yield executive


def _load_world(file: Path, robot: Robot, pool: Pool) -> World:
    """Return the bodies of a world file. A planner loads them, also their meshes.

    Raises:
        BadWorldFile: The file is wrong or missing, or a body does not fit the robot.
    """
    from .preview.world_file import in_file, read_world  # slow to import

    world = read_world(file)
    pool.start()
    answer = pool.ask(Verify([robot.boot_pose], 0.0, world=world))
    if isinstance(answer, BadWorld):
        raise in_file(file, answer)
    return world


def _check_port(setup: Setup, link: Link | None, report: Callable[[str], None]) -> None:
    """Check the port of a link. An error ends the start of a single user; a server reports it."""
    from hardware import SerialLink  # slow to import

    if not isinstance(link, SerialLink):
        return
    try:
        link.check()
    except LinkError as error:
        if setup.single_user:
            raise
        report(str(error))


def _switch_on(link: Link, stack: ExitStack) -> None:
    """Start the process of a virtual board now, so that the first goal does not wait for it."""
    from hardware.drivers.virtual.board_process import VirtualLink  # slow to import

    if isinstance(link, VirtualLink):
        stack.callback(link.close)
        link.switch_on()


def _library(setup: Setup, robot: Robot) -> TaskLibrary:
    if not setup.reload:
        return Library(setup.trees, robot.name)
    from trees.live_library import LiveLibrary  # slow to import

    return LiveLibrary(setup.trees, robot, setup.own_trees)


def load_own_skills(folder: Path | None) -> None:
    """Load the skills of a folder and of installed packages.

    Raises:
        ValueError: A skill is broken.
    """
    if broken := load_skills(folder, reserved_names()):
        raise ValueError("; ".join(broken))


def port_line(executive: Executive) -> str:
    """Return a line that names the port in use."""
    robot, port = executive.robot, executive.port
    if port == VIRTUAL and not robot.has_driver:
        return "Port virtual: the robot file names no driver; nothing real moves"
    if port == VIRTUAL:
        board = f"the virtual {robot.firmware.words.board}, firmware {robot.firmware.name}"
        return f"Port virtual: {board}; nothing real moves"
    if not port:
        return "Port: none"
    return f"Port {port}: firmware {robot.firmware.name}, {robot.serial.baud} baud"


def _tidy(setup: Setup, clock: Clock) -> Iterator[logs.LogLine]:
    """Recover incomplete recordings, and delete old ones."""
    for made in logs.recover_all(setup.recordings):
        yield _log_line(clock, _recovered(made))
    utc = utc_ns(clock) / 1e9
    for path in prune(setup.recordings, Rule(setup.keep_days, setup.keep_mb), utc):
        yield _log_line(clock, f"{path}: deleted, because of its age or the size of all recordings")


def _log_line(clock: Clock, words: str) -> logs.LogLine:
    return logs.LogLine(clock.now(), logging.WARNING, "logs", words)


def _recovered(made: logs.Summary | Exception) -> str:
    if isinstance(made, logs.Summary):
        shown = f"; `armtree log show {made.path}` shows what is left" if made.bytes else ""
        return made.text() + shown
    if isinstance(made, OSError) and made.filename:
        return f"not recovered: {made.filename}: {made.strerror}"
    return f"not recovered: {made}"
