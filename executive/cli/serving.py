"""Everything that `armtree serve` needs, put together."""

import gc
import logging
import logging.handlers
import queue
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from executive.errors import PoseUnconfirmed
from executive.executive import Executive
from executive.goals.events import Event
from executive.goals.questions import Questions
from executive.goals.queue import Policy
from executive.goals.start_pose import standing
from executive.live_library import LiveLibrary
from executive.server.server import ListenOptions, Server
from executive.server.token_file import PORT
from hardware import HardwareError, RealClock, TransitionRefused, load_robot
from logs import LogError
from logs.writing.retention import Rule
from skills.motion import Pool

from .interrupts import Interrupts
from .log_handler import LogHandler
from .wiring import PLANNING_TIMEOUT, port_line, put_in_order

logger = logging.getLogger(__name__)

# For so long a busy thread keeps the interpreter from the streamer, and from a stop [s].
_SWITCH = 0.0005


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """What was asked for on the command line or in the environment.

    Attributes:
        port: Serial port; None to take the robot file's.
        robot: Robot file; None for the shipped robot.
        trees: Folder with more tasks.
        recordings: Folder for recordings.
        seed: For whatever draws at random.
        workers: Planner processes.
        policy: What becomes of a second goal.
        result_timeout: How long results are kept [s]; see `Goals`.
        activate: Whether to activate the arm at once.
        pose: Where the arm stands, where its board is not reset; see `executive.goals.start_pose`.
        keep: Which recordings are kept.
        place: Where to listen, and to whom.
    """

    port: str | None
    robot: Path | None
    trees: Path | None
    recordings: Path
    seed: int
    workers: int
    policy: Policy
    result_timeout: float
    activate: bool
    pose: str | None
    keep: Rule
    place: ListenOptions


def serve(options: ServeOptions) -> None:
    """Serve until a signal comes; then stop the arm, end the goals and leave in order.

    Raises:
        HardwareError: The robot file is wrong, or names no driver.
        TreeError: The folder of tasks is.
        ServerError: It cannot listen as it was asked to.
        LogError: A recording cannot be made, or could not be finished.
    """
    sys.setswitchinterval(_SWITCH)
    with Interrupts() as interrupts, _log():
        robot, clock = load_robot(options.robot), RealClock()
        library = LiveLibrary(options.trees, robot)
        port = robot.serial.port if options.port is None else options.port
        if options.activate or options.pose:  # refused before all else
            standing(robot, port, options.pose, options.recordings)
        link = robot.link(port) if port else None
        early = put_in_order(options.recordings, options.keep, clock)
        for line in early:
            logger.warning("%s", line.message)
        questions = Questions(clock)
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
                _nobody,
                options.policy,
                options.result_timeout,
                operator=questions,
                pose=options.pose,
            )
            with Server(executive, library, robot, clock, options.place, questions) as server:
                logger.info("Token for whatever changes something: %s", server.token)
                for line in early:
                    executive.tell(line)
                with _recorded(executive, clock):  # all but the token
                    logger.info("%s", port_line(robot, port))
                    _announce(server, options)
                    executive.start()
                    with closing(executive):
                        server.start()
                        clock.spawn(lambda: prepare(executive, options.activate), "prepare")
                        interrupts.on_cancel(lambda: _leave(executive, interrupts))
                        interrupts.wait()
                        logger.info("Ending: the arm is stopped, goals are canceled")


def _leave(executive: Executive, interrupts: Interrupts) -> None:
    executive.cancel()
    interrupts.end()


def prepare(executive: Executive, activate: bool) -> None:
    """Configure the arm, and activate it where that is wanted; what the arm refuses, it logs."""
    try:
        executive.arm_to("configure")
        if activate:
            executive.arm_to("activate")
    except (PoseUnconfirmed, TransitionRefused, LogError) as error:
        logger.error("%s", error)
    except HardwareError as error:
        logger.debug("%s", error)  # the arm has logged it
    # What is loaded by now stays: to look through it again and again would hold the streamer, and
    # a stop, for 30 ms each time.
    gc.freeze()


def _announce(server: Server, options: ServeOptions) -> None:
    place = options.place
    elsewhere = "" if server.port == PORT else f"; its clients want --server {server.url}"
    logger.info(
        "Listening on %s; a second goal is handled by: %s%s",
        server.url,
        options.policy.value,
        elsewhere,
    )
    if place.expose:
        logger.warning(
            "EXPOSED: every machine that reaches %s port %d and knows the token can move this arm, "
            "and any can stop it; nothing is encrypted",
            place.address,
            server.port,
        )
    if place.rosbridge:
        logger.warning(
            "ROSBRIDGE: any program on this machine can move the arm through "
            "ws://%s, without a token",
            server.url.removeprefix("http://"),
        )
    if not options.activate:
        logger.info("The arm is not active, so goals fail; type: armtree arm activate")


def _nobody(_: Event) -> None:
    """Watches nothing; whoever wants to, subscribes."""


@contextmanager
def _recorded(executive: Executive, clock: RealClock) -> Iterator[None]:
    """Have the log recorded too."""
    handler = LogHandler(executive.tell, clock)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)


@contextmanager
def _log() -> Iterator[None]:
    """Print the log from a thread of its own: a slow or closed pipe must hold nothing up."""
    waiting: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    printing = logging.StreamHandler(sys.stderr)
    printing.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(message)s"))
    listener = logging.handlers.QueueListener(waiting, printing)
    root, put = logging.getLogger(), logging.handlers.QueueHandler(waiting)
    before = root.handlers[:]
    root.handlers[:] = [put]
    listener.start()
    try:
        yield
    finally:
        listener.stop()
        root.handlers[:] = before
