"""The full-screen view of a jog. It reads keys, starts moves, and shows the arm."""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from queue import SimpleQueue

import click

from executive.api.codes import OK
from executive.api.events import Where
from executive.api.move import Move
from executive.api.outcome import Cause, Outcome, cause_of
from executive.cli.terminal.key_screen import KeyScreen
from executive.errors import ClientError, GoalCanceled, Refused, ServerLost, ServerUnreachable
from hardware import HardwareError, NotActive
from hardware.loading.dataclass import dataclass
from skills.motion.errors import NEARER, MotionError
from trees import TreeError

from .arms import JogArm
from .model import Action, Call, Go, Jog, KeyCommand, Leave, Stop, Yes

# Errors of a command that the screen shows. Any other error ends the jog.
_SHOWN = (HardwareError, TreeError, click.ClickException)

_STRETCHED = "the arm is stretched out or at a limit: move a joint first"


# Function of a key's command. It receives the position of the arm and the typed text, and returns
# a message for the screen. The screen also shows the message of an exception in `_SHOWN`.
Act = Callable[[Where, str], str]


class ConfirmationNeeded(Exception):
    """A command needs an answer to a question before it acts.

    Args:
        text: The question, which y or n answers.
        then: Callback for y. It returns a message.
    """

    def __init__(self, text: str, then: Callable[[], str]) -> None:
        super().__init__(text)
        self.then = then


@dataclass(frozen=True, slots=True)
class _Ended:
    """A move has ended.

    Attributes:
        outcome: The outcome of the move.
        where: Position of the arm after the move.
    """

    outcome: Outcome
    where: Where


_Event = _Ended | Where | Exception


class JogScreen(KeyScreen):
    """The screen of a jog. Keys move the arm, until a key or a signal ends the jog.

    Args:
        arm: The arm.
        commands: Commands that do not move the arm, by key, each with its function.
        speed: Share of the robot's speed, 0.01 to 1.
        note: First message on the screen.
        title: Title of the screen, such as `armtree jog`.
        steps: Callback that returns the steps of the taught task as texts; None to show no steps.
    """

    def __init__(
        self,
        arm: JogArm,
        commands: Mapping[str, tuple[KeyCommand, Act]],
        speed: float,
        note: str,
        title: str,
        steps: Callable[[], Sequence[str]] | None,
    ) -> None:
        super().__init__()
        self._arm, self._acts = arm, commands
        self._title, self._steps = title, steps
        self._where = arm.where()
        titles = {key: command for key, (command, _) in commands.items()}
        self._jog = Jog.start(self._where, titles, speed, note)
        self._events: SimpleQueue[_Event] = SimpleQueue()
        self._worker = ThreadPoolExecutor(1, "jog")
        self._moves: Future[None] | None = None
        self._stops, self._stopping = 0, list[threading.Thread]()  # number of stops, running stops
        self._changed, self._looking = threading.Event(), threading.Lock()
        self._lost: ClientError | None = None
        self._asked: Callable[[], str] | None = None

    def run(self, keys: int) -> Where:
        """Jog until a key or `leave` ends the jog. Then return the position of the arm.

        Args:
            keys: File handle of the keyboard, which is read key by key.

        Raises:
            ClientError: The server is gone. The error is raised after the end of the jog.
        """
        for each in (self._watch, self._follow):
            threading.Thread(target=each, name="jog positions", daemon=True).start()
        with self._worker:
            try:
                self.show(keys)
            finally:
                self.end()
                if self._moves and not self._moves.done():
                    self.stop()
        if self._lost:
            raise self._lost
        return self._arm.where()

    def _watch(self) -> None:
        try:
            self._arm.watch(self._changed.set)
        except Exception as error:
            self._post(error)

    def _follow(self) -> None:
        """Read the position of the arm after every change, also after a change during a read."""
        while self._changed.wait() and not self._ended.is_set():
            self._changed.clear()
            try:
                self._look(lambda where: where)
            except Exception as error:
                self._post(error)

    def _look(self, event: Callable[[Where], _Event]) -> None:
        """Read and post the position of the arm. Values are posted in the order of the readings."""
        with self._looking:
            self._post(event(self._arm.where()))

    def update(self) -> None:
        """Update the position of the arm and the ends of moves in the view."""
        while not self._events.empty():
            self._take(self._events.get())

    def press(self, key: str) -> None:
        """Handle a key."""
        self._jog, action = self._jog.press(key)
        self._do(action)

    def lines(self, width: int, rows: int) -> Iterator[tuple[str, bool]]:
        """Return the lines of the screen, each with True if it belongs to an error."""
        steps = self._steps() if self._steps else None
        title = f"{self._title}   torque off" if self._arm.by_hand else self._title
        return self._jog.lines(self._where, width, rows, title, steps)

    def _take(self, event: _Event) -> None:
        match event:
            case Refused() | NotActive():  # the error of a read or stop; a move has an outcome
                self._jog = self._jog.said(str(event), failed=True)
            case ClientError():
                gone = isinstance(event, ServerUnreachable)
                self._lost = self._lost or (ServerLost() if gone else event)
                self._jog = self._jog.lose(cause_words(cause_of(self._lost)))
                self._where = replace(self._where, commanded=None, measured=None, tool=None)
            case Exception():
                raise event
            case Where():
                self._where = event
            case _Ended(outcome, where):
                self._where = where
                self._jog, action = self._jog.ended(*outcome_words(outcome))
                self._do(action)

    def _do(self, action: Action | None) -> None:
        match action:
            case Go(move=move):
                self._stopping = [stop for stop in self._stopping if stop.is_alive()]
                self._moves = self._worker.submit(self._move, move, self._stops, self._stopping)
            case Stop():
                self._stops += 1
                stop = threading.Thread(target=self._stop, name="stop", daemon=True)
                self._stopping = [*self._stopping, stop]
                stop.start()
            case Leave():
                self.end()
            case Call(key, text) as call:
                act = self._acts[key][1]
                self._act(lambda: act(self._where, text), lambda why: self._jog.refused(call, why))
            case Yes():
                assert self._asked
                self._act(self._asked, lambda why: self._jog.said(why, failed=True))

    def _act(self, act: Callable[[], str], refused: Callable[[str], Jog]) -> None:
        """Call a command, and show its message, question or error."""
        try:
            self._jog = self._jog.said(act())
        except ConfirmationNeeded as question:
            self._jog, self._asked = self._jog.ask(str(question)), question.then
        except _SHOWN as error:
            self._jog = refused(str(error))

    def _move(self, move: Move, stops: int, stopping: Sequence[threading.Thread]) -> None:
        """Execute a move.

        Args:
            move: The move.
            stops: Number of stops before the move.
            stopping: Running ones of these. They end first, or they would stop this move.
        """

        def accepted() -> None:
            if self._stops > stops:  # a stop after the key of the move
                self._stop()

        for stop in stopping:
            stop.join()
        try:
            outcome = self._arm.move(move, accepted)
            self._look(lambda where: _Ended(outcome, where))
        except Exception as error:
            self._post(error)

    def stop(self) -> None:
        """Stop the arm. Any thread may call."""
        self._stops += 1
        self._stop()

    def _stop(self) -> None:
        try:
            self._arm.stop()
        except Exception as error:
            self._post(error)

    def _post(self, event: _Event) -> None:
        self._events.put(event)
        self.wake()


def outcome_words(outcome: Outcome) -> tuple[str, bool]:
    """Return the message for the end of a move, and True if it is an error."""
    if outcome.code == OK:
        return "", False
    if outcome.code == GoalCanceled.code or outcome.cause is None:
        return "Stopped", False
    return cause_words(outcome.cause), True


def cause_words(cause: Cause) -> str:
    """Return code, message and hint of a cause, without the names of its planner and its node.

    The hint is at the end, which a small screen may cut off.
    """
    hint = f" -> {cause.advice}" if cause.advice else ""
    node = cause.node.rpartition("/")[2]
    words = cause.message.removeprefix(f"{MotionError.heading}: ").removeprefix(f"{node}: ")
    return f"{cause.code}: {words.replace(NEARER, _STRETCHED)}{hint}"
