"""Shows a recorded run at any speed. Keys pause the run, and change its speed and time."""

import contextlib
from pathlib import Path

from executive.api.events import Where
from executive.api.outcome import Outcome
from executive.recording.archive import restore_robot
from hardware import HardwareError, RealClock, State
from logs import LogError, Record, Recording, Result

from .keyboard import DOWN, LEFT, RIGHT, UP, key_by_key, pressed_keys
from .line_view import view_for
from .view import View

_TICK = 0.1  # longest time between two updates of the shown time [s]
_STEP = 1.0  # move of an arrow key within the recording [s]
_KEYS = "space pause, <- -> 1 s, up down speed, q quit"
_MOVES = {LEFT: -_STEP, RIGHT: _STEP}
_SPEEDS = {UP: 2.0, DOWN: 0.5}


class Player:
    """Shows the records of a recording at their times.

    Args:
        recording: The recording.
        view: Shows the records.
        speed: Factor of the speed; 2 is twice as fast.

    Attributes:
        speed: Factor of the speed; 2 is twice as fast.
        at: Current time within the recording [s since the first record].
    """

    def __init__(self, recording: Recording, view: View, speed: float) -> None:
        self._recording, self._view, self.speed = recording, view, speed
        first = next(recording.records(), None)
        self._zero = first.time if first else 0.0
        self._records = recording.records()
        self._next = next(self._records, None)
        self.at = 0.0

    @property
    def now(self) -> float:
        """Current time on the clock of the records [s]."""
        return self._zero + self.at

    @property
    def over(self) -> bool:
        """True if all records have been shown."""
        return self._next is None

    @property
    def due(self) -> float:
        """Time until the next record at the current speed [s]."""
        assert self._next
        return (self._next.time - self._zero - self.at) / self.speed

    def show_until(self, at: float) -> None:
        """Show all records up to a time [s since the first record], which may be in the past."""
        if at < self.at:
            self._records = self._recording.records()
            self._next = next(self._records, None)
        self.at = max(0.0, at)
        while self._next and self._next.time - self._zero <= self.at:
            self._show(self._next)
            self._next = next(self._records, None)

    def _show(self, record: Record) -> None:
        self._view.put(record)
        if isinstance(record, Result):
            self._view.put(Outcome.from_record(record, str(self._recording.path)))


def play(path: Path, speed: float, at: float | None, as_json: bool, verbose: bool) -> None:
    """Show a recording on standard output.

    Args:
        path: Path of the recording.
        speed: Factor of the speed; 2 is twice as fast.
        at: Show only this moment [s since the first record]; None to play the recording.
        as_json: True to print JSON.
        verbose: True to print lines instead of a live picture.

    Raises:
        LogError: The recording cannot be read.
    """
    recording = Recording(path)
    with view_for(as_json, verbose, lambda: player.now) as view, key_by_key() as keys:
        player = Player(recording, view, speed)
        with contextlib.suppress(HardwareError, LogError):  # without the robot, no bars are drawn
            view.put(Where.of(restore_robot(recording), State.UNCONFIGURED, None))
        if keys is not None:
            view.put(_KEYS)
        if at is not None:
            player.show_until(at)
        else:
            _play(player, keys)


def _play(player: Player, keys: int | None) -> None:
    clock, paused = RealClock(), False
    while not player.over:
        before = clock.now()
        pressed = pressed_keys(keys, None if paused else min(_TICK, max(0.0, player.due)))
        passed = 0.0 if paused else (clock.now() - before) * player.speed
        for key in pressed:
            if key == "q":
                return
            paused ^= key == " "
            player.speed *= _SPEEDS.get(key, 1.0)
            passed += _MOVES.get(key, 0.0)
        player.show_until(player.at + passed)
