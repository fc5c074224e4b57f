"""Runs the servers of `armtree serve` and `armtree view RECORDING`, until a signal arrives."""

import gc
import logging
import logging.handlers
import queue
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, nullcontext
from pathlib import Path
from urllib.parse import urlencode

from executive.api import PORT
from executive.cli.terminal.log_printer import LogPrinter
from executive.cli.terminal.streams import echo
from executive.errors import PoseUnconfirmed, SentBeforeStop
from executive.executive import Executive
from executive.fleet.worker_process import FleetPlace, worker_of
from executive.goals.questions import Questions
from executive.server.server import ListenOptions, Server, Viewer
from executive.session import open_executive, port_line
from executive.setup import Setup
from hardware import HardwareError, RealClock, TransitionRefused
from logs import LogError, NoSuchRecording

from .interrupts import Interrupts
from .log_handler import recorded_log
from .process import make_punctual

logger = logging.getLogger(__name__)


def serve(setup: Setup, listen: ListenOptions, fleet: FleetPlace | None = None) -> None:
    """Run the server until a signal arrives. Then stop the arm, cancel the goals and exit.

    Args:
        setup: The set-up of the arm.
        listen: Address and clients of the server.
        fleet: Fleet that the arm joins, or None.

    Raises:
        HardwareError: The robot file is wrong or names no driver, or the start pose is unconfirmed.
        TreeError: The folder of tasks cannot be read.
        ServerError: The server cannot listen as configured.
        LogError: A recording cannot be created or completed.
    """
    make_punctual()
    clock = RealClock()
    questions = Questions(clock)
    with ExitStack() as stack:
        interrupts = stack.enter_context(Interrupts())
        stack.enter_context(_log())
        executive = stack.enter_context(open_executive(setup, clock=clock, operator=questions))
        server = stack.enter_context(Server(executive, listen, questions))
        logger.info("Token for requests that change something: %s", server.token)
        logger.info("Link to the page, which works once: %s", server.sign_in.link())
        with recorded_log(executive):  # from here on, so that no recording has the token or link
            logger.info("%s", port_line(executive))
            executive.start()
            stops = executive.status().stops
            with closing(executive):
                interrupts.on_cancel(lambda: _leave(executive, interrupts))
                server.start()
                _announce(server, executive, listen)
                clock.spawn(lambda: prepare(executive, stops), "prepare")
                page = listen.page(server.port)
                with worker_of(fleet, server.url, server.token, page) if fleet else nullcontext():
                    interrupts.wait()
                    logger.info("Ending: the arm is stopped, goals are canceled")


def view_recordings(path: Path, show: Callable[[str], None]) -> None:
    """Serve a page that shows recordings, until a signal arrives.

    Args:
        path: A recording, or a folder of recordings.
        show: Callback that shows the link to the page.

    Raises:
        ServerError: The server cannot listen.
        RecordingError: There is no such file.
    """
    folder, named = (path, {}) if path.is_dir() else (path.parent, {"recording": path.name})
    if named and not path.is_file():
        raise NoSuchRecording(folder, f"{path.name} does not exist")
    with Interrupts("Ended at once.") as interrupts, Viewer(folder, RealClock()) as viewer:
        viewer.start()
        interrupts.on_cancel(interrupts.end)
        show(viewer.sign_in.link() + (f"&{urlencode(named)}" if named else ""))
        echo("Recordings only, no arm. Ctrl-C ends this command.", err=True)
        interrupts.wait()


def _leave(executive: Executive, interrupts: Interrupts) -> None:
    executive.cancel()
    interrupts.end()


def prepare(executive: Executive, stops: int) -> None:
    """Configure the arm, and activate it if the set-up demands it. Errors are logged.

    Args:
        executive: Executive that owns the arm.
        stops: Number of stops so far. After another stop, the arm is not activated.
    """
    try:
        executive.arm_to("configure")
        if executive.setup.activate:
            executive.arm_to("activate", stops=stops)
    except (PoseUnconfirmed, SentBeforeStop, TransitionRefused, LogError) as error:
        logger.error("%s", error)
    except HardwareError as error:
        logger.debug("%s", error)  # the arm has logged the error
    gc.freeze()  # as in `make_punctual`, now also for the objects of the executive


def _announce(server: Server, executive: Executive, listen: ListenOptions) -> None:
    elsewhere = "" if server.port == PORT else f"; clients need --server {server.url}"
    logger.info(
        "Listening on %s; policy for a second goal: %s%s",
        server.url,
        executive.setup.policy.value,
        elsewhere,
    )
    if listen.expose:
        logger.warning(
            "EXPOSED: a machine that reaches %s port %d can stop this arm, and move it if it knows "
            "the token; nothing is encrypted",
            listen.address,
            server.port,
        )
    if listen.rosbridge:
        logger.warning(
            "ROSBRIDGE: any program on this machine can move the arm through "
            "ws://%s, without a token",
            server.url.removeprefix("http://"),
        )
    if not executive.setup.activate:
        logger.info("The arm is not active, so goals fail; type: armtree arm activate")


@contextmanager
def _log() -> Iterator[None]:
    """Print the log on its own thread, so that a slow or closed pipe cannot block the server."""
    lines: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = logging.handlers.QueueListener(lines, LogPrinter())
    root, put = logging.getLogger(), logging.handlers.QueueHandler(lines)
    before = root.handlers[:]
    root.handlers[:] = [put]
    listener.start()
    try:
        yield
    finally:
        listener.stop()
        root.handlers[:] = before
