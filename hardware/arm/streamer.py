"""The streamer: a thread that plays schedules, each frame at its absolute deadline."""

import logging
import math
from collections.abc import Callable
from enum import Enum
from functools import partial

from hardware.clock import Clock
from hardware.errors import HardwareError, NotActive, NotArrived, StaleGeneration, WriteRefused

from .board_session import BoardSession
from .events import OBSERVER_TIMEOUT
from .measured_guard import MeasuredGuard
from .schedule import Schedule
from .write_guard import Claim, WriteGuard

logger = logging.getLogger(__name__)

_READY_WAIT = 0.02  # time between two checks for a stop of the motion [s]


class PlaybackState(Enum):
    """State of a playback."""

    PLAYING = "playing"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


class Playback:
    """The playback of a schedule. Only the streamer changes it. Every thread may read it.

    Args:
        schedule: The schedule.
        claim: Claim under which the frames are written.
        sent_before: Number of frames sent before this playback.
        on_change: Callback after every change.

    Attributes:
        schedule: The schedule.
        claim: Claim under which the frames are written.
        written: Number of setpoints whose frames were written.
        arrived: Number of setpoints whose frames the board has acknowledged, or `written` if the
            board acknowledges none.
        state: State of the playback.
        error: The error if the playback failed, else None.
        max_lateness: Largest lateness of a frame so far [s].
        gripped: True if a gripper closed on an object. The motion then ends, and is not resumed,
            even if it was stopped before.
        loosened: Commanded poses that loosened a gripper after a stop of the motion [rad]. Empty
            if the rest of the motion moves the gripper away from its object.
    """

    def __init__(
        self, schedule: Schedule, claim: Claim, sent_before: int, on_change: Callable[[], None]
    ) -> None:
        self.schedule = schedule
        self.claim, self._sent_before = claim, sent_before
        self.written = self.arrived = 0
        self.state = PlaybackState.PLAYING
        self.error: HardwareError | None = None
        self.max_lateness = 0.0
        self.gripped = False
        self.loosened: tuple[tuple[float, ...], ...] = ()
        self._on_change = on_change

    @property
    def playing(self) -> bool:
        """True until the playback has ended."""
        return self.state is PlaybackState.PLAYING

    @property
    def sent_all(self) -> bool:
        """True if every frame was written."""
        return self.written == len(self.schedule.setpoints)

    def note_written(self, lateness: float, acknowledged: int) -> None:
        """Count a frame that was written.

        Args:
            lateness: Lateness of the frame [s].
            acknowledged: Number of frames acknowledged since the port was opened.
        """
        self.max_lateness = max(self.max_lateness, lateness)
        self.written += 1
        self.note_acknowledged(acknowledged)

    def note_acknowledged(self, acknowledged: int) -> None:
        """Update `arrived` from the number of frames acknowledged since the port was opened."""
        arrived = min(acknowledged - self._sent_before, self.written)  # a hold is not a setpoint
        self.arrived = max(self.arrived, arrived)

    def finish(self, state: PlaybackState, error: HardwareError | None = None) -> None:
        """Set the final state. Only the first call counts."""
        if self.playing:
            self.error, self.state = error, state

    def notify(self) -> None:
        """Call the callback. The caller must not hold a lock."""
        try:
            self._on_change()
        except Exception:
            logger.exception("the callback of a motion failed")


class Streamer:
    """A thread that plays one schedule at a time.

    Args:
        guard: The write guard.
        session: The protocol of the board. The thread polls it.
        clock: Time source.
        period: Period of frames [s]. A frame that is late by more than this delays the rest of the
            motion.
        on_fault: Callback for errors. It must close this streamer.
        ready: Callback that waits until the next frame may be sent, at most the given time [s].
            It returns True if the frame may be sent. It raises `WriteRefused` to end the motion.
        measured: The measured guard.

    Attributes:
        thread: The thread. It ends soon after the streamer is closed.
    """

    def __init__(
        self,
        guard: WriteGuard,
        session: BoardSession,
        clock: Clock,
        period: float,
        on_fault: Callable[[BaseException], None],
        ready: Callable[[float], bool],
        measured: MeasuredGuard,
    ) -> None:
        self._guard, self._session, self._clock = guard, session, clock
        self._period, self._on_fault, self._ready = period, on_fault, ready
        self._measured = measured
        self._signal = clock.signal()
        self._playback: Playback | None = None
        self._stopped: Playback | None = None  # the last motion, if it was stopped
        self._braking: tuple[float, float] | None = None  # start and duration [s]
        self._closing = False
        self._cause: HardwareError | None = None  # fault that closed the streamer
        self.thread = clock.spawn(self._run, "streamer")

    def play(
        self, schedule: Schedule, on_change: Callable[[], None], owner: str, generation: int
    ) -> Playback:
        """Start to play a schedule now.

        Args:
            schedule: The schedule.
            on_change: Callback after every frame and at the end of the motion, from another thread.
                It may also be called without a change. The streamer logs its exceptions.
            owner: Name of the owner of the motion.
            generation: Generation of the guard in which the motion was planned.

        Raises:
            NotActive: The streamer was closed.
            ArmClaimed: Another motion is being played.
            StaleGeneration: The arm was stopped, or another motion ended, after the planning.
        """
        with self._signal:
            if self._closing:
                raise NotActive("the arm left the active state; configure and activate it first")
            claim = self._guard.claim(owner, generation)
            self._playback = Playback(schedule, claim, self._session.sent, on_change)
            self._stopped = self._braking = None
            self._signal.notify()
            return self._playback

    def on_received(self) -> None:
        """Process new reports of the board, such as acknowledgements."""
        with self._signal:
            playback = self._playback
            before = playback.arrived if playback else 0
            if playback:
                playback.note_acknowledged(self._session.acknowledged)
            self._signal.notify()
        if playback and playback.arrived != before:
            playback.notify()

    def wait_until_acknowledged(self) -> None:
        """Wait until the board has acknowledged all frames or the streamer is closed."""
        with self._signal:
            while not (self._closing or self._session.all_acknowledged()):
                self._signal.wait(None)

    def stop(self, brake: float = 0.0) -> None:
        """Drop the rest of the schedule and hold.

        Args:
            brake: Time in which the motion slows down evenly before the hold [s]; 0 to hold now.

        Raises:
            LinkError: The hold frame could not be written. The playback ends with this fault.
        """
        if brake and self._start_braking(brake):
            return
        try:
            self._guard.hold()
        except NotActive:  # the fault that ended *active* also ends the playback
            until = self._clock.now() + OBSERVER_TIMEOUT
            with self._signal:
                while self.playing and self._clock.now() < until:
                    self._signal.wait(until)
        self._drop(PlaybackState.STOPPED)

    def _start_braking(self, brake: float) -> bool:
        """Start to slow down, unless this has begun. Return False if no motion is left."""
        with self._signal:
            playback = self._playback
            if not self.playing or not playback or playback.sent_all or playback.gripped:
                return False
            if self._braking is None:
                self._braking = self._clock.now(), brake
                self._signal.notify()
            return True

    def close(self, error: HardwareError | None = None) -> None:
        """Close the guard and drop the rest of the motion, without a hold frame. May be repeated.

        Args:
            error: The fault that caused this, or None.
        """
        with self._signal:
            self._closing = True
            self._cause = self._cause or error  # set before the closed guard can refuse a frame
        self._guard.close()
        self._drop(PlaybackState.FAILED if self._cause else PlaybackState.STOPPED, self._cause)

    @property
    def playing(self) -> bool:
        """True while a schedule is being played."""
        playback = self._playback
        return playback is not None and playback.playing

    def _drop(self, state: PlaybackState, error: HardwareError | None = None) -> None:
        """End the playback, from any thread, and wake the thread of the streamer."""
        self._guard.flush_events()  # reports the last frame before the end of the motion
        with self._signal:
            playback, self._playback = self._playback, None
            if playback:
                playback.finish(state, error)
                self._stopped = playback
            self._signal.notify()
        if playback:
            playback.notify()

    def _run(self) -> None:
        try:
            while playback := self._next():
                self._play_to_end(playback)
        except NotActive:
            self.close()  # the fault that ended *active* is already reported
        except BaseException as error:  # a driver may raise any exception
            self._on_fault(error)

    def _play_to_end(self, playback: Playback) -> None:
        try:
            self._play(playback)
            self._end(playback, PlaybackState.DONE)
        except StaleGeneration:
            self._end(playback, PlaybackState.STOPPED)
        except NotActive:
            raise
        except (WriteRefused, NotArrived) as error:
            logger.error("%s", error)
            self._end(playback, PlaybackState.FAILED, error)

    def _end(
        self, playback: Playback, state: PlaybackState, error: HardwareError | None = None
    ) -> None:
        self._guard.flush_events()
        with self._signal:
            self._guard.release(playback.claim)
            playback.finish(state, error)
        playback.notify()

    def _next(self) -> Playback | None:
        """Wait for a playback, and loosen stalled grippers. Return None when closing."""
        while True:
            self._wait(
                lambda: not (self._closing or self.playing or self._pushes), lambda: math.inf
            )
            with self._signal:
                if self._closing or self.playing:
                    return None if self._closing else self._playback
            self._loosen_at_rest()

    @property
    def _pushes(self) -> bool:
        """True if a gripper must be loosened while no motion is played.

        Between two schedules that continue each other, it is False.
        """
        last = self._playback
        return self._measured.stalled and not (last and last.schedule.continues)

    def _loosen_at_rest(self) -> None:
        """Loosen a stalled gripper after a motion."""
        commanded, stopped = self._guard.commanded, self._stopped
        pose = self._measured.loosened(commanded, self._clock.now())
        if not pose:
            return
        if stopped and not _leaves(stopped, commanded, pose):
            stopped.loosened += (pose,)  # before the frame: its observer may resume the motion
        if self._guard.loosen(pose) and stopped:
            stopped.gripped |= _only_pushes(stopped, commanded, pose)

    def _play(self, playback: Playback) -> None:
        origin, schedule = self._clock.now(), playback.schedule
        for setpoint in schedule.setpoints:
            self._wait_for_frame(playback, origin + setpoint.time)
            if self._loosen(playback):
                break
            self._wait_until_ready(playback)
            due = self._due(origin + setpoint.time)
            if due == math.inf:
                self._guard.hold(playback.claim)
                raise StaleGeneration("slowed down to a stop")
            late = self._clock.now() - due
            if late > self._period:
                origin += late
            self._guard.write(setpoint.positions, playback.claim, due)
            with self._signal:
                playback.note_written(late, self._session.acknowledged)
            playback.notify()
        else:
            self._wait_until_ready(playback)
            self._guard.write(schedule.end, playback.claim, self._clock.now())
            if schedule.setpoints:
                self._sleep(playback, max(origin + schedule.duration, self._guard.done))
        if schedule.setpoints:
            self._sleep(playback, math.inf, self._session.all_acknowledged)
            if not schedule.continues:
                self._wait_until_settled(playback)

    def _loosen(self, playback: Playback) -> bool:
        """Loosen a stalled gripper if the rest of the motion only moves it further on.

        Returns:
            True if a frame was sent. The gripper then holds an object, and the motion ends.
        """
        commanded = self._guard.commanded
        pose = self._measured.loosened(commanded, self._clock.now())
        if pose is None or not _only_pushes(playback, commanded, pose):
            return False
        playback.gripped |= self._guard.loosen(pose, playback.claim)
        return playback.gripped

    def _wait_until_settled(self, playback: Playback) -> None:
        """Wait until the measured joints have reached the end of the motion.

        A gripper that stalls meanwhile is loosened.

        Raises:
            NotArrived: A joint has not reached its end position within `settle_s`.
        """
        end, measured = playback.schedule.end, self._measured
        since = self._clock.now()
        until = since + measured.settle_s
        settled = partial(measured.has_settled, end, since)
        while self._clock.now() < until and not settled():
            self._sleep(playback, until, lambda: measured.stalled or settled())
            if measured.stalled:
                self._wait_for_frame(playback, self._clock.now())
                self._loosen(playback)
        measured.check_arrived(end)

    def _wait_for_frame(self, playback: Playback, planned: float) -> None:
        """Wait until a frame with this planned time [s] is due. Braking may delay the frame."""

        def due() -> float:
            until = max(self._due(planned), self._guard.earliest)
            return until if until < math.inf else -math.inf  # braking ends before this frame

        self._wait(lambda: playback is self._playback, due)
        if playback is not self._playback:
            raise StaleGeneration("stopped")

    def _wait_until_ready(self, playback: Playback) -> None:
        """Wait until the next frame may be sent. Holds no lock, because a stop may come."""
        while not self._ready(_READY_WAIT):
            if playback is not self._playback:
                raise StaleGeneration("stopped")

    def _due(self, planned: float) -> float:
        """Return the time at which a frame is due [s]; inf if braking ends before this frame.

        Braking lowers the speed of playback from 1 to 0 within a duration T. After a time t, it has
        played s = t - t^2 / 2T of the schedule, at most T / 2. The frame is due at the t that
        solves this equation for the frame's s.
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

    def _wait(self, waiting: Callable[[], bool], until: Callable[[], float]) -> None:
        """Wait while a condition holds, at most until a time [s]. Poll the board meanwhile.

        Raises:
            BoardError: The board does not answer in time.
        """
        while True:
            earliest = self._guard.poll()  # without the lock, because it calls an observer
            with self._signal:
                end = until()
                if not waiting() or self._clock.now() >= end:
                    return
                first = min(end, max(self._session.next_poll, earliest))
                self._signal.wait(None if first == math.inf else first)

    def _sleep(
        self, playback: Playback, until: float, is_over: Callable[[], bool] = lambda: False
    ) -> None:
        """Wait until a time [s], or until `is_over` returns True.

        Raises:
            StaleGeneration: The playback was stopped meanwhile.
            BoardError: The board does not answer in time.
        """
        self._wait(lambda: playback is self._playback and not is_over(), lambda: until)
        if playback is not self._playback:
            raise StaleGeneration("stopped")


def _leaves(playback: Playback, commanded: tuple[float, ...], loosened: tuple[float, ...]) -> bool:
    """Return True if the rest of a motion moves a stalled gripper away from its object.

    Args:
        playback: The motion.
        commanded: Commanded positions, one per joint [rad].
        loosened: Positions in which the grippers push less, one per joint [rad].
    """
    return any(
        (goal - q) * (q - less) < 0
        for setpoint in playback.schedule.setpoints[playback.written :]
        for goal, q, less in zip(setpoint.positions, commanded, loosened, strict=True)
    )


def _only_pushes(
    playback: Playback, commanded: tuple[float, ...], loosened: tuple[float, ...]
) -> bool:
    """Return True if the rest of a motion moves only stalled grippers, and none of them back.

    The arguments are those of `_leaves`.
    """
    return not _leaves(playback, commanded, loosened) and all(
        goal == q
        for setpoint in playback.schedule.setpoints[playback.written :]
        for goal, q, less in zip(setpoint.positions, commanded, loosened, strict=True)
        if less == q
    )
