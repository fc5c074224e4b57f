"""Plays schedules: every frame at its time, on absolute deadlines, in a thread of its own."""

import contextlib
import logging
import math
from collections.abc import Callable
from enum import Enum

from hardware.clock import Clock
from hardware.errors import HardwareError, NotActive, StaleGeneration, WriteRefused

from .acknowledgements import Acknowledgements
from .interfaces import Claim
from .schedule import Schedule
from .write_guard import WriteGuard

logger = logging.getLogger(__name__)


class PlaybackState(Enum):
    """How far a playback is."""

    PLAYING = "playing"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


class Playback:
    """A schedule being played. Written by the streamer, read by anybody.

    Attributes:
        schedule: What is played.
        claim: By which it is written.
        written: Setpoints whose frames were written.
        arrived: Setpoints whose frames the board has; it is not later than it says so, and where
            it says nothing, those that were written.
        state: How far it is.
        error: What failed, where it failed.
        latest: Largest lateness of a frame so far [s].
    """

    def __init__(
        self, schedule: Schedule, claim: Claim, began: int, changed: Callable[[], None]
    ) -> None:
        self.schedule = schedule
        self.claim, self._began = claim, began
        self.written = self.arrived = 0
        self.state = PlaybackState.PLAYING
        self.error: HardwareError | None = None
        self.latest = 0.0
        self._changed = changed

    @property
    def sent_all(self) -> bool:
        """Whether every frame was written."""
        return self.written == len(self.schedule.setpoints)

    def wrote(self, lateness: float, taken: int) -> None:
        """Note a frame that was written.

        Args:
            lateness: By how much it was late [s].
            taken: Frames that the board has, those from before included.
        """
        self.latest = max(self.latest, lateness)
        self.written += 1
        self.took(taken)

    def took(self, taken: int) -> None:
        """Note how many frames the board has, those from before included."""
        self.arrived = max(self.arrived, taken - self._began)

    def end(self, state: PlaybackState, error: HardwareError | None = None) -> None:
        """Note how it ended; only the first end counts."""
        if self.state is PlaybackState.PLAYING:
            self.error, self.state = error, state

    def tell(self) -> None:
        """Tell who watches that something may have changed; hold no lock meanwhile."""
        try:
            self._changed()
        except Exception:
            logger.exception("who watches a motion failed")


class Streamer:
    """A thread that plays one schedule at a time.

    Args:
        door: Through which it writes.
        dialogue: Which knows what has arrived.
        clock: Whose time.
        period: Lateness up to this is absorbed; beyond it the rest shifts by it [s].
        fault: Told what failed; it closes this streamer.

    Attributes:
        thread: It ends soon after this streamer is closed.
    """

    def __init__(
        self,
        door: WriteGuard,
        dialogue: Acknowledgements,
        clock: Clock,
        period: float,
        fault: Callable[[BaseException], None],
    ) -> None:
        self._door, self._dialogue, self._clock = door, dialogue, clock
        self._period, self._fault = period, fault
        self._signal = clock.signal()
        self._playback: Playback | None = None
        self._braking: tuple[float, float] | None = None  # since when and for how long [s]
        self._closing = False
        self._why: HardwareError | None = None  # it was closed
        self.thread = clock.spawn(self._run, "streamer")

    def play(
        self, schedule: Schedule, changed: Callable[[], None], owner: str, generation: int
    ) -> Playback:
        """Begin to play, from now on.

        Args:
            schedule: What to play.
            changed: Called from another thread after every frame and at the end, and sometimes
                where nothing has changed; what it raises is logged.
            owner: Whose motion it is.
            generation: The door's, when the motion was decided on.

        Raises:
            NotActive: The streamer was closed.
            InterfaceClaimed: Another motion is being played.
            StaleGeneration: There was a stop, or another motion, since then.
        """
        with self._signal:
            if self._closing:
                raise NotActive("the arm left the active state; configure and activate it first")
            claim = self._door.claim(owner, self._door.interfaces, generation)
            self._playback = Playback(schedule, claim, self._dialogue.sent, changed)
            self._braking = None
            self._signal.notify()
            return self._playback

    def heard(self) -> None:
        """Note that the board said something."""
        with self._signal:
            if playback := self._playback:
                playback.took(self._dialogue.taken)
            self._signal.notify()
        if playback:
            playback.tell()

    def settle(self) -> None:
        """Wait until the board has answered what it was sent, or this streamer is closed.

        Raises:
            FrameLost: It does not answer in time.
        """
        with self._signal:
            while not self._closing and self._dialogue.due is not None:
                self._wait()

    def stop(self, brake: float = 0.0) -> None:
        """Drop what is left and hold.

        Args:
            brake: How long to slow down before, evenly and along the schedule [s].

        Raises:
            LinkError: The hold frame could not be written; the playback ends with that fault.
        """
        if brake and self._brakes(brake):
            return
        with contextlib.suppress(NotActive):  # whatever took it out of *active* stops it, too
            self._door.hold()
        self._drop(PlaybackState.STOPPED)

    def _brakes(self, brake: float) -> bool:
        """Begin to slow down, or go on with it; false where there is nothing left to slow down."""
        with self._signal:
            playback = self._playback
            if not self.playing or not playback or playback.sent_all:
                return False
            if self._braking is None:
                self._braking = self._clock.now(), brake
                self._signal.notify()
            return True

    def close(self, error: HardwareError | None = None) -> None:
        """Shut the door and drop what is left, without a hold frame. Harmless when closed.

        Args:
            error: Why, where a fault is the reason.
        """
        with self._signal:
            self._closing = True
            self._why = self._why or error  # known before a frame can come to a shut door
        self._door.close()
        self._drop(PlaybackState.FAILED if self._why else PlaybackState.STOPPED, self._why)

    @property
    def playing(self) -> bool:
        """Whether a schedule is being played."""
        playback = self._playback
        return playback is not None and playback.state is PlaybackState.PLAYING

    def _drop(self, state: PlaybackState, error: HardwareError | None = None) -> None:
        """End what is played, whoever plays it, and wake the thread."""
        self._door.tell()  # the end of a motion is told after the last of its frames
        with self._signal:
            playback, self._playback = self._playback, None
            if playback:
                playback.end(state, error)
            self._signal.notify()
        if playback:
            playback.tell()

    def _run(self) -> None:
        try:
            while playback := self._next():
                self._play_to_its_end(playback)
        except NotActive:
            self.close()  # who took the arm out of *active* says why
        except BaseException as error:  # a driver may raise what it likes
            self._fault(error)

    def _play_to_its_end(self, playback: Playback) -> None:
        try:
            self._play(playback)
            self._end(playback, PlaybackState.DONE)
        except StaleGeneration:
            self._end(playback, PlaybackState.STOPPED)
        except NotActive:
            raise
        except WriteRefused as error:
            logger.error("%s", error)
            self._end(playback, PlaybackState.FAILED, error)

    def _end(
        self, playback: Playback, state: PlaybackState, error: HardwareError | None = None
    ) -> None:
        self._door.tell()
        with self._signal:
            self._door.give_up(playback.claim)
            playback.end(state, error)
        playback.tell()

    def _next(self) -> Playback | None:
        """Wait for a playback, and for the answer to what was sent before; None when closing."""
        with self._signal:
            while not (self._closing or self.playing):
                self._wait()
            return None if self._closing else self._playback

    def _play(self, playback: Playback) -> None:
        origin = self._clock.now()
        for setpoint in playback.schedule.setpoints:
            self._await(playback, origin + setpoint.time)
            due = self._due(origin + setpoint.time)
            if due == math.inf:
                self._door.hold(playback.claim)
                raise StaleGeneration("slowed down to a stop")
            late = self._clock.now() - due
            if late > self._period:
                origin += late
            self._dialogue.check(self._clock.now())
            self._door.write(setpoint.positions, playback.claim, due)
            with self._signal:
                playback.wrote(late, self._dialogue.taken)
            playback.tell()
        self._door.write(playback.schedule.end, playback.claim, self._clock.now())
        if playback.schedule.setpoints:
            self._sleep(playback, max(origin + playback.schedule.duration, self._door.done))
            self._sleep(playback, math.inf, self._dialogue.settled)

    def _await(self, playback: Playback, planned: float) -> None:
        """Wait until a frame is due that was planned for a time [s]; braking may shift it."""
        with self._signal:
            while playback is self._playback:
                until = max(self._due(planned), self._door.earliest)
                if until == math.inf or self._clock.now() >= until:
                    return
                self._wait(until)
        raise StaleGeneration("stopped")

    def _due(self, planned: float) -> float:
        """When a frame is due that was planned for a time [s]; infinite where braking ends before.

        Slowing down evenly to rest within T covers half of what T would: the time t(s) at which
        the schedule's s is reached solves s = t - t^2 / 2T.
        """
        if self._braking is None:
            return planned
        since, brake = self._braking
        ahead = planned - since
        if ahead <= 0:
            return planned
        if ahead >= brake / 2:
            return math.inf
        return since + brake * (1 - math.sqrt(1 - 2 * ahead / brake))

    def _wait(self, until: float = math.inf) -> None:
        """Wait for a time [s], or for news, and see to it that the board answers meanwhile.

        Raises:
            FrameLost: It leaves a frame without an answer.
        """
        self._dialogue.check(self._clock.now())
        due = self._dialogue.due
        first = until if due is None else min(until, due)
        self._signal.wait(None if first == math.inf else first)

    def _sleep(
        self, playback: Playback, until: float, over: Callable[[], bool] = lambda: False
    ) -> None:
        """Wait for a time [s], or until it is over.

        Raises:
            StaleGeneration: The playback was stopped meanwhile.
            FrameLost: The board leaves a frame without an answer.
        """
        with self._signal:
            while playback is self._playback and not over() and self._clock.now() < until:
                self._wait(until)
            if playback is not self._playback:
                raise StaleGeneration("stopped")
