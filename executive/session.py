"""From a set-up to an executive: for the command line, the server, tests and users."""

import json
import logging
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import logs
from hardware import VIRTUAL, Clock, Link, RealClock, Robot
from logs.writing.retention import Rule, prune
from skills import Leader, Operator
from skills.motion import Pool
from skills.user_skills import load_skills
from trees import Library
from trees.nodes.kind import reserved_names

from .api.events import Event
from .api.move import Move, number_of
from .api.outcome import GoalState, Outcome
from .errors import ResultTimeout, UnknownGoal
from .executive import Executive
from .setup import Setup

if TYPE_CHECKING:
    from trees.live_library import LiveLibrary

logger = logging.getLogger(__name__)

_SLICE = 0.5  # longest single wait for an outcome, so that Ctrl-C is noticed [s]


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
    """Make the executive of a set-up; close it and its planners at the end.

    Recordings that a crash left incomplete are recovered, and old ones deleted, first. The caller
    starts the executive.

    Args:
        setup: The set-up.
        clock: Time source; default: real time.
        link: Link to the board; default: that of the set-up's port.
        pool: Planners; they stay open. Default: planners of its own.
        operator: Answers the questions of tasks; default: none does.
        leader: Arm that is moved by hand, for `FollowLeader`; default: none.
        subscriber: Callback for every event, from any thread.
        report: Receives what was done to earlier recordings, one line each.

    Raises:
        HardwareError: The robot file is wrong, names no driver, or the start pose is not confirmed.
        TreeError: The folder of tasks cannot be read.
        LogError: At the end: a recording could not be finished.
    """
    robot, clock = setup.load_robot(), clock or RealClock()
    library = _library(setup, robot)
    port = robot.serial.port if setup.port is None else setup.port
    if link is None and port:
        link = robot.link(port)
    early = list(_tidy(setup, clock))
    for line in early:
        report(line.message)
    with ExitStack() as stack:
        if pool is None:
            pool = stack.enter_context(closing(Pool(robot, setup.workers, clock)))
        executive = Executive(setup, robot, link, library, pool, clock, operator, leader)
        if subscriber:
            executive.subscribe(subscriber)
        for line in early:
            executive.record(line)
        with closing(executive):
            if setup.single_user or setup.activate or setup.pose:
                executive.start_pose.find()  # rejected before the port is opened
            yield executive


def _library(setup: Setup, robot: Robot) -> "Library | LiveLibrary":
    if not setup.reload:
        return Library(setup.trees, robot.name)
    from trees.live_library import LiveLibrary  # slow to import: it checks whole files

    return LiveLibrary(setup.trees, robot)


def run_task(executive: Executive, task: int | str | Move, arguments: Mapping[str, Any]) -> Outcome:
    """Run a task or a move, wait for its end, and finish its recording. Ctrl-C cancels it.

    Args:
        executive: A started executive with a single user.
        task: Number or name of the task, or a move.
        arguments: Values of its parameters, by name.

    Returns:
        The outcome, also that of a goal that was rejected.

    Raises:
        UnknownTask: No task has that number or name.
        TypeError: A value is of a type that no parameter has.
        KeyboardInterrupt: Ctrl-C was pressed. The goal has ended, and the arm has stopped.
    """
    number = task if isinstance(task, Move) else executive.library.number(task)
    texts = {name: _text(name, value) for name, value in arguments.items()}
    goal = uuid.uuid4().hex
    try:
        outcome = _outcome(executive, number, texts, goal)
    except KeyboardInterrupt:
        executive.cancel()
        with suppress(UnknownGoal):
            finish_recording(executive, executive.result(goal))
        raise
    return finish_recording(executive, outcome)


def _outcome(
    executive: Executive, task: int | Move, texts: Mapping[str, str], goal: str
) -> Outcome:
    answer = executive.send(task, texts, goal)
    if answer.cause:
        return Outcome.of(number_of(task), GoalState.ABORTED, answer.cause)
    while True:
        # A Ctrl-C just before the wait does not end the wait: the next slice raises it.
        with suppress(ResultTimeout):
            return executive.result(goal, _SLICE)


def _text(name: str, value: object) -> str:
    """Return an argument as text, as it is written in a task file."""
    try:
        return value if isinstance(value, str) else json.dumps(value)
    except TypeError as error:
        raise TypeError(f"argument {name} = {value!r}: {error}") from None


def finish_recording(executive: Executive, outcome: Outcome) -> Outcome:
    """Finish the recording of a goal; return its outcome, with what is wrong with the recording."""
    try:
        executive.finish_recording()
    except logs.LogError as error:
        if outcome.success:
            return replace(outcome, code=error.code, message=str(error))
        cause, words = outcome.cause, str(error)
        if cause and words not in cause.message:
            cause = replace(cause, message=f"{cause.message}; {words}")
        message = outcome.message if words in outcome.message else f"{outcome.message}; {words}"
        return replace(outcome, message=message, cause=cause)
    return outcome


def load_own_skills(folder: Path | None) -> None:
    """Load the skills of a folder and of installed packages.

    Raises:
        ValueError: One of them is broken.
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
    """Recover the recordings that a crash left incomplete, and delete old ones."""
    for made in logs.recover_all(setup.recordings):
        yield _log_line(clock, _recovered(made))
    utc = clock.epoch_ns() / 1e9 + clock.now()
    for path in prune(setup.recordings, Rule(setup.keep_days, setup.keep_mb), utc):
        yield _log_line(clock, f"{path}: deleted to make room")


def _log_line(clock: Clock, words: str) -> logs.LogLine:
    return logs.LogLine(clock.now(), logging.WARNING, "logs", words)


def _recovered(made: logs.Summary | Exception) -> str:
    if isinstance(made, logs.Summary):
        shown = f"; `armtree log show {made.path}` shows what is left" if made.bytes else ""
        return made.text() + shown
    if isinstance(made, OSError) and made.filename:
        return f"not recovered: {made.filename}: {made.strerror}"
    return f"not recovered: {made}"
