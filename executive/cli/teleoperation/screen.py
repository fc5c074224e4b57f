"""The full-screen view of an arm that follows a leader, an arm that a person moves by hand."""

import math
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from enum import Enum
from textwrap import wrap

from executive.api.codes import OK
from executive.api.events import Where
from executive.api.move import LEADER, Move
from executive.api.outcome import Outcome
from executive.cli.jogging.arms import OwnArm
from executive.cli.jogging.screen import cause_words, outcome_words
from executive.cli.terminal.key_screen import KeyScreen
from executive.errors import GoalCanceled
from hardware import DISPLAY_UNITS, HardwareError, Joint, State
from hardware.loading.dataclass import dataclass
from skills import Blocked

from .servo_leader import HandGuidedArm

_REDRAW = 0.1  # longest time between two drawings [s]
_NEAR = math.radians(2)  # largest distance to follow without a planned move first [rad], [m]
_ROUNDING = 1e-6  # largest rounding error of a position in a move's words [rad], [m]
_NAMED = 16  # smallest width of the name of a joint [columns]


class Phase(Enum):
    """Phase of the following arm. The value is for people."""

    ASKS = "waits for you"
    HOLDS = "holds"
    APPROACHES = "moves to the leader"
    FOLLOWS = "follows"
    LOST = "holds; the leader is lost"


@dataclass(frozen=True, slots=True)
class View:
    """The content of the view.

    Attributes:
        phase: Phase of the arm.
        leader: Measured position of the leader by joint [rad]; None if it is lost.
        where: Position of the arm.
        blocked: Reason that the arm does not follow; None if it follows.
        message: Last message of the arm, for people.
        failed: True if the message is an error.
        lost: Reason that the leader is lost; empty if it is not lost.
    """

    phase: Phase
    leader: Mapping[str, float] | None
    where: Where
    blocked: Blocked | None = None
    message: str = ""
    failed: bool = False
    lost: str = ""

    def lines(self, width: int, rows: int) -> Iterator[tuple[str, bool]]:
        """Return the lines of the screen, each with True if it belongs to an error.

        Args:
            width: Number of columns.
            rows: Number of lines.
        """
        blocked = self.phase is Phase.FOLLOWS and self.blocked
        said = wrap(f"Blocked: {blocked.contact}" if blocked else self.message, width)
        if self.lost not in self.message:  # the message of a failed goal may have this error
            said += wrap(f"Leader: {self.lost}", width)
        wrong = bool(blocked or self.failed or self.lost)
        body = list(self._joints())
        does = "waits at an obstacle" if blocked else self.phase.value
        lines = [(f"armtree teleop   arm {self.where.arm.value}, {does}", False)]
        lines += [(line, False) for line in body[: max(rows - len(said) - 2, 1)]]
        lines += [(line, wrong) for line in said]
        lines += [(self._help, False)]
        for line, error in lines[:rows]:
            yield line[:width].rstrip(), error

    def _joints(self) -> Iterator[str]:
        longest = max(_NAMED, *map(len, self.where.units))
        free = self.blocked and self.phase is Phase.FOLLOWS
        head = f"{'':<{longest}}{'leader':>10}{'commanded':>11}{'measured':>10}"
        yield f"{head}{'':6}{'free' if free else ''}"
        for name, unit in self.where.units.items():
            columns = self.leader, self.where.commanded, self.where.measured
            leader, commanded, measured = (_shown(each, name, unit) for each in columns)
            arrows = _arrows(*self.blocked.free[name]) if self.blocked and free else ""
            row = f"{name:<{longest}}{leader:>10}{commanded:>11}{measured:>10}"
            yield f"{row} {DISPLAY_UNITS[unit][1]:<5}{arrows}"

    @property
    def _help(self) -> str:
        match self.phase:
            case Phase.ASKS:
                return "y release the leader   q leave"
            case Phase.HOLDS | Phase.LOST if self.failed and self.where.arm is State.UNCONFIGURED:
                return "q leave, then start armtree teleop again"  # only a person ends the error
            case Phase.LOST:
                return "q leave"
            case Phase.HOLDS:
                return "space follow   q leave"
            case _:
                return "space hold   q leave"


class TeleopScreen(KeyScreen):
    """The screen of teleoperation: makes an arm follow a leader, and shows both.

    Args:
        arm: The arm that follows.
        joints: Actuated joints of this arm.
        leader: The leader.
        speed: Share of the robot's speed, 0.01 to 1.
    """

    def __init__(
        self, arm: OwnArm, joints: Sequence[Joint], leader: HandGuidedArm, speed: float
    ) -> None:
        super().__init__(_REDRAW)
        self._arm, self._joints, self._leader, self._speed = arm, joints, leader, speed
        self._lock = threading.Lock()  # held while the view changes
        question = "The leader loses its torque and falls unless you hold it. Do you hold it? y/n"
        self._view = View(Phase.ASKS, None, arm.where(), message=question)
        self._worker = ThreadPoolExecutor(1, "teleop")
        self._following: Future[None] | None = None

    def run(self, keys: int) -> Where:
        """Follow until a key or `leave` ends the screen. Then return the position of the arm.

        Args:
            keys: File handle of the keyboard, which is read key by key.
        """
        with self._worker:
            try:
                self.show(keys)
            finally:
                self.end()
                self.stop()
        return self._arm.where()

    def lines(self, width: int, rows: int) -> Iterator[tuple[str, bool]]:
        """Return the lines of the screen, each with True if it belongs to an error."""
        return self._view.lines(width, rows)

    def press(self, key: str) -> None:
        """Execute the command of a key."""
        phase = self._view.phase
        if key == "q" or (key == "n" and phase is Phase.ASKS):
            self.end()
        elif key == "y" and phase is Phase.ASKS:
            self._release()
        elif key == " " and phase in (Phase.APPROACHES, Phase.FOLLOWS):
            self.stop()
        elif key == " " and phase is Phase.HOLDS:
            self._start()

    def _release(self) -> None:
        try:
            self._leader.release()
        except HardwareError as error:
            self._lose(error)
            return
        self._start()

    def _start(self) -> None:
        if self._following:
            self._following.result()  # its end clears the values that are set below
        self._show(Phase.APPROACHES, "")
        self._leader.following = True
        self._following = self._worker.submit(self._follow)

    def stop(self) -> None:
        """Stop following, or stop the move to the leader."""
        self._leader.following = False
        if self._view.phase is Phase.APPROACHES:
            self._arm.stop()

    def _follow(self) -> None:
        """Move to the position of the leader, and follow it. Show the outcome."""
        try:
            outcome = self._approach()
            if (outcome is None or outcome.code == OK) and self._leader.following:
                self._show(Phase.FOLLOWS, "")
                outcome = self._arm.move(Move((LEADER,), speed=self._speed), _nothing)
            self._show(Phase.HOLDS, *_words(outcome))
        except HardwareError as error:  # the position of the leader cannot be read
            self._lose(error)
        finally:
            self._leader.following = False
            self.wake()

    def _approach(self) -> Outcome | None:
        """Move to the leader's position if it is far away. Return the outcome; None without a move.

        If the leader is beyond a limit of a joint, the arm moves to the limit.
        """
        pairs = zip(self._joints, self._leader.where(), strict=True)
        target = {
            joint.name: min(max(q, joint.lower + _ROUNDING), joint.upper - _ROUNDING)
            for joint, q in pairs
        }
        there = self._arm.where().commanded
        if there and all(abs(there[name] - q) < _NEAR for name, q in target.items()):
            return None
        words = tuple(f"{name}={q:.6f}" for name, q in target.items())
        return self._arm.move(Move(words, speed=self._speed), self._accepted)

    def _accepted(self) -> None:
        if not self._leader.following:  # the stop came before the move
            self._arm.stop()

    def update(self) -> None:
        """Update the positions of both arms in the view."""
        if self._following and self._following.done():
            self._following.result()  # raises an unexpected error
        where, blocked, leader = self._arm.where(), self._leader.blocked, None
        try:
            leader = dict(zip(where.units, self._leader.where(), strict=True))
        except HardwareError as error:
            self._lose(error)
        fault = self._arm.fault()
        with self._lock:
            self._view = replace(self._view, leader=leader, where=where, blocked=blocked)
            if fault and fault.message not in self._view.message:  # no goal has reported it
                self._view = replace(self._view, message=cause_words(fault), failed=True)

    def _lose(self, error: HardwareError) -> None:
        """Show that the leader is lost, and do not move to its last position."""
        if self._view.phase is Phase.APPROACHES:
            self.stop()
        with self._lock:
            self._view = replace(self._view, phase=Phase.LOST, lost=str(error))

    def _show(self, phase: Phase, message: str, failed: bool = False) -> None:
        """Show a phase and a message. A lost leader stays lost."""
        with self._lock:
            phase = self._view.phase if self._view.phase is Phase.LOST else phase
            self._view = replace(self._view, phase=phase, message=message, failed=failed)


def _nothing() -> None:
    """Do nothing."""


def _words(outcome: Outcome | None) -> tuple[str, bool]:
    """Return the message for the end of a goal, and True if it is an error."""
    ended = outcome and outcome.code != GoalCanceled.code
    return outcome_words(outcome) if outcome and ended else ("", False)


def _shown(positions: Mapping[str, float] | None, name: str, unit: str) -> str:
    if positions is None:
        return "?"
    return f"{DISPLAY_UNITS[unit][0] * positions[name]:z.1f}"


def _arrows(down: bool, up: bool) -> str:
    return f"{'<-' if down else '  '} {'->' if up else '  '}"
