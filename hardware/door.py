"""The one door to the wire: the only place that writes to the port, and the guard in front of it.

Trees, planners and servers may be wrong; this may not. It checks by itself, at every write, that
the arm is active, that the motion is the current one, that every value is finite and within its
limits, and that the board can digest the frame now.
"""

import threading
from collections.abc import Callable, Sequence

from .clock import Clock
from .errors import LinkError, NotActive, StaleGeneration, TooFast
from .events import FrameSent, Observer
from .frames import Codec, Frame
from .link import Link
from .pace import Pace
from .robot import Robot


class Door:
    """Writes commanded positions to the board.

    Args:
        robot: Whose limits and firmware count.
        link: Where to write.
        clock: Whose time.
        active: Tells whether the lifecycle stands in *active*.
        observe: Told of every frame, after it was written.
        positions: Where the arm stands, one value per actuated joint [rad].
    """

    def __init__(
        self,
        robot: Robot,
        link: Link,
        clock: Clock,
        active: Callable[[], bool],
        observe: Observer,
        positions: tuple[float, ...],
    ) -> None:
        self._robot, self._link, self._clock = robot, link, clock
        self._active, self._observe = active, observe
        self._codec = Codec(robot.actuated)
        self._lock = threading.RLock()  # an observer, or a signal's handler, may hold the arm
        self._generation = 0
        self._closed = self._hold_due = False
        self._commanded = positions
        self._holds = self._codec.encode(self._commanded)
        self._pace = Pace(robot.firmware, robot.serial.baud, self._holds)

    @property
    def commanded(self) -> tuple[float, ...]:
        """Where the arm was last commanded to, one value per actuated joint [rad]."""
        return self._commanded

    @property
    def earliest(self) -> float:
        """When the board can take the next frame [s]."""
        return self._pace.earliest

    @property
    def done(self) -> float:
        """When the board is done with what it was sent [s]."""
        return self._pace.done

    @property
    def generation(self) -> int:
        """Number of the motion that may write; every stop ends it."""
        return self._generation

    def renew(self, generation: int) -> int:
        """Begin a new generation; whoever still writes for an older one is refused.

        Args:
            generation: The one that is to be followed.

        Raises:
            StaleGeneration: It has ended already.
        """
        with self._lock:
            self._check_generation(generation)
            self._generation += 1
            return self._generation

    def close(self) -> None:
        """Shut the door for good; a write that is under way ends first."""
        with self._lock:
            self._closed = True

    def write(self, positions: Sequence[float], generation: int, scheduled: float) -> bool:
        """Command positions; a frame of the same bytes as the last is not sent again.

        Args:
            positions: One value per actuated joint [rad].
            generation: Whose motion this is.
            scheduled: When this was due [s].

        Returns:
            Whether a frame was sent.

        Raises:
            WriteRefused: Not active, an old generation, a bad value, or too much for the board.
            PortLost: The port went away; what the board got is unknown.
            PortStalled: The board takes no more; likewise.
        """
        with self._lock:
            self._check_active()
            self._check_generation(generation)
            frame = self._codec.encode(positions)
            if frame != self._holds:
                self._check_pace(frame)
                self._send(frame, tuple(positions), scheduled)
                return True
            self._commanded = tuple(positions)
            return False

    def hold(self) -> None:
        """End the generation and repeat the last frame, once; nothing if none was written since.

        Raises:
            NotActive: Only an active arm is written to.
            PortLost: The port went away.
            PortStalled: The board takes no more.
        """
        with self._lock:
            self._generation += 1
            if self._hold_due:
                self._check_active()
                self._send(self._holds, self._commanded, None)

    def _check_active(self) -> None:
        if self._closed or not self._active():
            raise NotActive("the arm is not active; configure and activate it first")

    def _check_generation(self, generation: int) -> None:
        if generation != self._generation:
            raise StaleGeneration("this motion was stopped; nothing more is sent for it")

    def _check_pace(self, frame: Frame) -> None:
        step, most = self._pace.step(frame), self._robot.firmware.max_step
        if step > most:
            raise TooFast(f"{frame} turns the servos by {step} degrees in sum; the most is {most}")
        early = self._pace.earliest - self._clock.now()
        if early > 0:
            raise TooFast(f"{frame} comes {early * 1000:.1f} ms before the board has room for it")

    def _send(self, frame: Frame, positions: tuple[float, ...], scheduled: float | None) -> None:
        now = self._clock.now()
        self._hold_due = scheduled is not None
        try:
            self._link.write(frame.data)
        except LinkError:
            self._closed = True  # what the board got is unknown, so nothing may follow
            raise
        self._pace.sent(frame, now)
        self._holds, self._commanded = frame, positions
        self._observe(FrameSent(now, frame.data, positions, scheduled))
