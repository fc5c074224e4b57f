"""The one door to the wire: the only place that writes to the port, and the guard in front of it.

Trees, planners and servers may be wrong; this may not. It checks by itself, at every write, that
the arm is active, that the motion is the current one, that every value is finite and within its
limits, and that the board can digest the frame now.
"""

import contextlib
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence

from hardware.clock import Clock
from hardware.description.robot import Robot
from hardware.drivers.driver import Frame
from hardware.drivers.pacing import Pace
from hardware.errors import BadPosition, DriverFailed, LinkError, NotActive, PortStalled, TooFast
from hardware.joints import check_position
from hardware.link.link import Link

from .acknowledgements import Acknowledgements
from .events import PATIENCE, CommandSent, FrameSent, Observer, Outbox
from .interfaces import Claim, Claims, command_interfaces

# A write that takes longer than all these waits is stuck. They are several, because a stall of the
# whole host ends one of them at once, without the writer having had its time.
_WAITS, _WAIT = 10, PATIENCE / 10  # how many, and how long one is [s]


class WriteGuard:
    """Writes commanded positions to the board.

    Args:
        robot: Whose limits and firmware count.
        link: Where to write.
        clock: Whose time.
        active: Tells whether the lifecycle stands in *active*.
        observe: Told of all that was written, in order, while no lock is held.
        dialogue: Which counts what goes out.
        positions: Where the arm stands, one value per actuated joint [rad].

    Attributes:
        interfaces: The command interfaces, in the order of the fields in a frame.
    """

    def __init__(
        self,
        robot: Robot,
        link: Link,
        clock: Clock,
        active: Callable[[], bool],
        observe: Observer,
        dialogue: Acknowledgements,
        positions: tuple[float, ...],
    ) -> None:
        self._robot, self._link, self._clock = robot, link, clock
        self._active, self._dialogue, self._outbox = active, dialogue, Outbox(observe)
        self._codec = robot.wire_format
        self._lock = threading.RLock()  # a signal's handler may hold the arm
        self.interfaces = command_interfaces(robot)
        self._claims = Claims(self.interfaces)
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
        """Counts the ends of motions, and stops; a motion is decided on in one."""
        return self._claims.generation

    def claim(self, owner: str, interfaces: Iterable[str], generation: int) -> Claim:
        """Claim command interfaces, for a motion that was decided on in a generation.

        Raises:
            WriteRefused: Unknown, claimed by another, or there was a stop since then.
            PortStalled: A write does not return.
        """
        with self._alone():
            return self._claims.take(owner, interfaces, generation)

    def give_up(self, claim: Claim) -> None:
        """End a claim. Harmless when it has ended.

        Raises:
            PortStalled: A write does not return.
        """
        with self._alone():
            self._claims.give_up(claim)

    def greet(self) -> None:
        """Ask a board that has booted to acknowledge frames, if it can.

        Raises:
            NotActive: Only an active arm is written to.
            LinkError: The port failed.
        """
        with self._alone():
            self._check_active()
            if greeting := self._dialogue.greeting:
                self._put(greeting)
                self._outbox.put(CommandSent(self._clock.now(), greeting))
        self._outbox.deliver()

    def close(self) -> None:
        """Shut the door for good; a write that is under way ends first, and is told."""
        self._closed = True
        with contextlib.suppress(PortStalled), self._alone():  # stuck: nothing follows either way
            pass
        self.tell()

    def tell(self) -> None:
        """See that all that was written is told, also where another thread is at it."""
        self._outbox.deliver(PATIENCE)

    def write(self, positions: Sequence[float], claim: Claim, scheduled: float) -> bool:
        """Command positions; a frame of the same bytes as the last is not sent again.

        Args:
            positions: One value per claimed interface [rad]; the other joints stay.
            claim: Whose motion this is.
            scheduled: When this was due [s].

        Returns:
            Whether a frame was sent.

        Raises:
            WriteRefused: Not active, a claim that ended, a bad value, or too much for the board.
            PortLost: The port went away; what the board got is unknown.
            PortStalled: The board takes no more, or a write does not return; likewise.
        """
        with self._alone():
            self._check_active()
            self._claims.check(claim)
            target = self._target(positions, claim)
            frame = self._codec.encode(target)
            sends = frame != self._holds
            if sends:
                self._check_pace(frame)
                self._send(frame, target, scheduled)
            self._commanded = target
        self._outbox.deliver()
        return sends

    def hold(self, claim: Claim | None = None) -> None:
        """End all claims and repeat the last frame, once; nothing if none was written since.

        Args:
            claim: Whose motion shall be held; all where it is left out.

        Raises:
            NotActive: Only an active arm is written to.
            StaleGeneration: That claim has ended.
            PortLost: The port went away.
            PortStalled: The board takes no more, or a write does not return.
        """
        with self._alone():
            if claim:
                self._claims.check(claim)
            self._claims.end()
            due, self._hold_due = self._hold_due, False  # a signal's handler may come in between
            if due:
                self._check_active()
                self._send(self._holds, self._commanded, None)
        self._outbox.deliver()

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Keep everybody else out, once the write that is under way has ended."""
        if not any(self._lock.acquire(timeout=_WAIT) for _ in range(_WAITS)):
            raise PortStalled(self._link.port, "A write to the port does not return")
        try:
            yield
        finally:
            self._lock.release()

    def _check_active(self) -> None:
        if self._closed or not self._active():
            raise NotActive("the arm is not active; configure and activate it first")

    def _target(self, positions: Sequence[float], claim: Claim) -> tuple[float, ...]:
        if len(positions) != len(claim.interfaces):
            names = ", ".join(claim.interfaces)
            raise BadPosition(f"{len(positions)} values for {len(claim.interfaces)}: {names}")
        commanded = dict(zip(self.interfaces, self._commanded, strict=True))
        commanded.update(zip(claim.interfaces, positions, strict=True))
        joints = zip(self._robot.actuated, commanded.values(), strict=True)
        return tuple(check_position(joint, q) for joint, q in joints)

    def _check_pace(self, frame: Frame) -> None:
        step, most = self._pace.step(frame), self._robot.firmware.max_step
        if step > most:
            raise TooFast(f"{frame} turns the servos by {step} degrees in sum; the most is {most}")
        early = self._pace.earliest - self._clock.now()
        if early > 0:
            raise TooFast(f"{frame} comes {early * 1000:.1f} ms before the board has room for it")

    def _send(self, frame: Frame, positions: tuple[float, ...], scheduled: float | None) -> None:
        began = self._clock.now()
        self._hold_due = scheduled is not None
        self._dialogue.sends(frame, began)
        self._put(frame.data)
        self._pace.sent(frame, self._clock.now())  # after the write, which may have waited
        self._holds = frame
        self._outbox.put(FrameSent(began, frame.data, positions, scheduled))

    def _put(self, data: bytes) -> None:
        try:
            self._link.write(data)
        except BaseException as error:
            self._closed = True  # what the board got is unknown, so nothing may follow
            if isinstance(error, LinkError) or not isinstance(error, Exception):
                raise
            raise DriverFailed(error) from error  # also one of ours that only a guard may raise
