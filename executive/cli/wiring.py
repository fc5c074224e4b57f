"""Everything that `armtree run` needs, put together."""

import logging
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import logs
from executive.executive import Executive
from executive.goals.events import Event
from executive.goals.outcome import GoalState, GoalStatus, Outcome, cause_of
from executive.goals.start_pose import standing
from executive.task_sequence import TaskSequence
from hardware import VIRTUAL, HardwareError, RealClock, Robot, load_robot
from logs.writing.retention import Rule, prune
from skills.motion import Pool
from trees import Library, Located, TreeError
from trees.compile.arguments import read_arguments

from .interrupts import Interrupts
from .log_handler import LogHandler
from .terminal import Terminal
from .view import JsonView, TextView, View

PLANNING_TIMEOUT = 5.0  # [s]


@dataclass(frozen=True, slots=True)
class Options:
    """What was asked for on the command line or in the environment.

    Attributes:
        numbers: Tasks to run.
        port: None to take the robot file's.
        robot: Robot file; None for the shipped robot.
        trees: Folder with more tasks.
        skills: Folder with more skills; they are loaded already.
        settings: Parameters of the task, each as NAME=VALUE.
        recordings: Folder for recordings.
        seed: For whatever draws at random.
        workers: Planner processes.
        json: Whether to print JSON.
        verbose: Whether the log is shown, so that no live picture may be in its way.
        keep_days: Older recordings go; None to keep them.
        keep_mb: The oldest recordings beyond so many megabytes go; None to keep them.
        pose: Where the arm stands, where its board is not reset; see `executive.goals.start_pose`.
    """

    numbers: tuple[int, ...]
    port: str | None
    robot: Path | None
    trees: Path | None
    skills: Path | None
    settings: tuple[str, ...]
    recordings: Path
    seed: int
    workers: int
    json: bool
    verbose: bool
    keep_days: float | None = None
    keep_mb: float | None = None
    pose: str | None = None


def execute(options: Options) -> list[Outcome]:
    """Run tasks from the command line; returns the outcomes, at least one."""
    with Interrupts() as interrupts, view_for(options.json, options.verbose) as view:
        try:
            robot, library = load_robot(options.robot), Library(options.trees)
            arguments = read_arguments(options.settings, options.numbers)
            port = robot.serial.port if options.port is None else options.port
            standing(robot, port, options.pose, options.recordings)  # refused before all else
            link = robot.link(port) if port else None
        except (HardwareError, TreeError) as error:
            outcome = Outcome.of(options.numbers[0], GoalState.ABORTED, cause_of(error))
            view.report(outcome)
            return [outcome]
        view.say(port_line(robot, port))
        clock = RealClock()
        rule = Rule(options.keep_days, options.keep_mb)
        early = put_in_order(options.recordings, rule, clock)
        for line in early:
            view.say(line.message)
        with closing(Pool(robot, options.workers, clock)) as pool:
            executive = Executive(
                robot,
                link,
                library,
                pool,
                options.recordings,
                clock,
                options.seed,
                PLANNING_TIMEOUT,
                partial(_show, view),
                single_user=True,
                pose=options.pose,
                operator=Terminal(_to_errors if options.json else view.say),
            )
            for line in early:
                executive.tell(line)
            return _drive(executive, clock, options.numbers, arguments, view, interrupts)


def _show(view: View, event: Event) -> None:
    if not isinstance(event, GoalStatus):
        view.watch(event)


def put_in_order(folder: Path, rule: Rule, clock: RealClock) -> list[logs.LogLine]:
    """Mend what a crash left among recordings, and make room by the rule; says both."""
    said = [_recovered(made) for made in logs.recover_all(folder)]
    utc = clock.epoch_ns() / 1e9 + clock.now()
    said += [f"{path}: deleted to make room" for path in prune(folder, rule, utc)]
    return [logs.LogLine(clock.now(), logging.WARNING, "logs", words) for words in said]


def _recovered(made: logs.Summary | Exception) -> str:
    if isinstance(made, logs.Summary):
        shown = f"; `armtree log show {made.path}` tells what is left" if made.bytes else ""
        return made.text() + shown
    if isinstance(made, OSError) and made.filename:
        return f"not recovered: {made.filename}: {made.strerror}"
    return f"not recovered: {made}"


def _drive(
    executive: Executive,
    clock: RealClock,
    numbers: Sequence[int],
    arguments: Mapping[str, Located],
    view: View,
    interrupts: Interrupts,
) -> list[Outcome]:
    """Run on a thread of its own; this one waits for signals."""
    outcomes: list[Outcome] = []
    bugs: list[Exception] = []
    in_turn = TaskSequence(executive)
    interrupts.on_cancel(in_turn.cancel)

    def drive() -> None:
        try:
            outcomes.extend(in_turn.run(numbers, view.report, arguments))
        except Exception as error:  # carried over to the thread that tells the user
            bugs.append(error)
        finally:
            interrupts.end()

    handler = LogHandler(executive.tell, clock)
    logging.getLogger().addHandler(handler)
    driver = clock.spawn(drive, "driver")
    interrupts.wait()
    driver.join()
    logging.getLogger().removeHandler(handler)
    if bugs:
        raise bugs[0]
    return outcomes


def view_for(json: bool, verbose: bool) -> View:
    """What shows a run here.

    Args:
        json: Whether JSON is wanted.
        verbose: Whether the log is shown, so that no live picture may be in its way.
    """
    if json:
        return JsonView()
    if verbose or not sys.stdout.isatty():
        return TextView()
    from rich.console import Console

    from .live_view import LiveView

    return LiveView(Console())


def _to_errors(text: str) -> None:
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def port_line(robot: Robot, port: str) -> str:
    """Which port is used, in words."""
    if port == VIRTUAL:
        return (
            f"Port virtual: the virtual Arduino, firmware {robot.firmware.name}; nothing real moves"
        )
    if not port:
        return "Port: none"
    return f"Port {port}: firmware {robot.firmware.name}, {robot.serial.baud} baud"
