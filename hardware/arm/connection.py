"""The connection to a board, from activation to deactivation."""

import logging
import math
import threading
from collections.abc import Callable

from hardware.clock import Clock
from hardware.description.guards import TORQUE_OFF
from hardware.description.robot import Robot
from hardware.drivers.firmware_profile import Ability
from hardware.errors import (
    ActivationStopped,
    HardwareError,
    LinkError,
    NotActive,
    PoseOutsideLimits,
)
from hardware.joints import rounded
from hardware.link.link import Link
from hardware.link.timed_link import TimedLink

from .board_session import BoardSession
from .events import OBSERVER_TIMEOUT, BytesReceived, Measured, Observer
from .measured_guard import MeasuredGuard
from .streamer import Streamer
from .write_guard import WriteGuard

logger = logging.getLogger(__name__)


class Connection:
    """A connection to a board: link, write guard, reading thread and, after the boot, a streamer.

    Args:
        robot: The robot.
        start_pose: Pose of the arm, one position per actuated joint [rad]. A pose that the board
            reports takes precedence.
        link: Link to the board.
        clock: Time source.
        observe: Callback for all bytes in both directions.
        is_active: Callback that returns True if the lifecycle is *active*.
        on_fault: Callback for errors, from any thread.
        on_receive: Callback after bytes were received.
        ready: Callback that waits until the next frame may be sent; see `Streamer`.

    Attributes:
        session: The protocol of the board.
        guard: The write guard.
        streamer: The streamer, or None before `start`.
    """

    def __init__(
        self,
        robot: Robot,
        start_pose: tuple[float, ...],
        link: Link,
        clock: Clock,
        observe: Observer,
        is_active: Callable[[], bool],
        on_fault: Callable[[BaseException], None],
        on_receive: Callable[[], None],
        ready: Callable[[float], bool],
    ) -> None:
        self._robot, self._link, self._clock = robot, TimedLink(link, clock), clock
        self._observe, self._start_pose = observe, start_pose
        self._on_fault, self._on_receive, self._ready = on_fault, on_receive, ready
        self._closed = self._last_words = False
        self._switching, self._waiting = robot.can(Ability.TORQUE), clock.signal()
        self._moves_in = False  # True while joints move back inside their limits
        self._measured_guard = MeasuredGuard(robot.actuated, robot.guards, robot.grips)
        self._reader: threading.Thread | None = None
        self.session = BoardSession(robot.protocol())
        self.guard = WriteGuard(
            robot, self._link, clock, is_active, observe, self.session, start_pose
        )
        self.streamer: Streamer | None = None

    def open(self) -> None:
        """Open the port, which resets the board, and start to read.

        Raises:
            LinkError: The port cannot be opened.
        """
        self._link.open()
        self._reader = self._clock.spawn(self._read, "listener")

    def start(self, waited: float) -> None:
        """Create the streamer of a booted board.

        Args:
            waited: Time since the port was opened [s].

        Raises:
            BoardError: A required report of the board is missing, such as the end of its boot.
            PoseOutsideLimits: A servo is outside the limits of its joint.
            MeasuredFault: A servo is too hot, or its voltage is too low.
        """
        self.session.check_booted(self._link.port, waited)
        if measured := self.session.measured:
            now = self._clock.now()
            self._measured_guard.check(measured.position, measured, now, active=False)
        self.guard.start_from(self._held_pose())
        period = 1 / self._robot.firmware.rate
        self.streamer = Streamer(
            self.guard,
            self.session,
            self._clock,
            period,
            self._fault,
            self._ready,
            self._measured_guard,
        )

    def send_start_commands(self) -> None:
        """Send the start commands of the board, and switch the torque on."""
        try:
            self.guard.send_start_commands()
            if self._robot.can(Ability.TORQUE):
                self._switch_torque(True, 0)  # 0: any stop during this connection ends this call
        except NotActive:
            return  # a fault came first
        except Exception as error:  # a driver may raise any exception
            self._fault(error)

    def switch_torque(self, on: bool) -> None:
        """Switch the torque of all servos. This ends any motion.

        Raises:
            NotActive: The arm is not active.
            PoseOutsideLimits: The arm is outside its limits. The torque is still off.
            ActivationStopped: The arm was stopped before all joints were within their limits. Its
                servos with torque hold their measured positions. The arm is unconfigured.
        """
        generation = self.guard.release_torque()
        try:
            self._switch_torque(on, generation)
        except ActivationStopped as error:
            self._fault(error)
            raise

    def wait_for_torque(self) -> None:
        """Wait until the torque of the servos has been switched."""
        with self._waiting:
            while self._switching and not self._closed:
                self._waiting.wait(None)

    def _switch_torque(self, on: bool, generation: int) -> None:
        """Send the commands for the torque. If they move a joint, a stop ends them.

        Args:
            on: True to switch the torque on; False to switch it off.
            generation: Generation of the guard. Any later generation shows a stop.
        """
        self._switching = True
        try:
            commands = self.session.torque_commands(on)
            self._moves_in = on and self._start_from_held_pose()
            due, period = self._clock.now(), 1 / self._robot.firmware.rate
            for command in commands:
                if self._moves_in and self.guard.generation != generation:
                    raise ActivationStopped(
                        "the arm was stopped before its joints were within their limits; servos"
                        " with torque hold their measured positions",
                        "configure and activate the arm again",
                    )
                while not self.guard.send_torque_command(command):
                    self._pause(self.session.free_at)
                due = max(due + period, self._clock.now())  # after a wait, no commands in a burst
                self._pause(due)
            self.guard.torque = on
        finally:
            self._moves_in = False
            with self._waiting:
                self._switching = False
                self._waiting.notify()

    def _start_from_held_pose(self) -> bool:
        """Set the pose that the board reports as the commanded pose, before the torque is on.

        Returns:
            True if a joint is outside its limits. The torque commands then move it to its limit.

        Raises:
            PoseOutsideLimits: The arm is outside its limits. The torque stays off.
        """
        try:
            pose = self._held_pose()
        except PoseOutsideLimits:
            self.session.torque_commands(False)  # not sent: the protocol then expects no torque
            raise
        self.guard.start_from(pose)
        if (frame := self.session.boot_frame) is None:
            return False
        measured = self._robot.unlimited.decode(frame)
        least = math.radians(self._robot.guards.settle_deg)
        for joint, q, near in zip(self._robot.actuated, measured, pose, strict=True):
            if abs(q - near) > least:
                words = joint.name, rounded(q, joint.unit), rounded(near, joint.unit)
                way = "%s is at %s, and moves to its limit, %s; "
                logger.warning(way + "this motion is not checked for collisions", *words)
        return frame != self._robot.wire_format.encode(pose)

    def _pause(self, until: float) -> None:
        with self._waiting:
            while self._clock.now() < until and not self._closed:
                self._waiting.wait(until)

    def send_fault_commands(self, error: HardwareError) -> None:
        """Hold the measured positions, or release the joints, as the robot file specifies.

        Args:
            error: The fault. After a fault of the link, nothing is sent. After ActivationStopped,
                the joints hold in any case.
        """
        if not self._robot.can(Ability.MEASURE) or isinstance(error, LinkError):
            return
        self._last_words = True
        try:
            releases = self._robot.guards.on_fault == TORQUE_OFF
            self.guard.send_fault_commands(releases and not isinstance(error, ActivationStopped))
        except Exception as failure:  # a driver may raise any exception
            logger.error("Holding the arm after a fault failed: %s", failure)

    def hold(self, brake: float = 0.0) -> None:
        """Drop the rest of the motion and hold.

        Args:
            brake: Time to slow down before holding [s].
        """
        try:
            if self.streamer:
                self.streamer.stop(brake)
        except Exception as error:  # a driver may raise any exception
            self._fault(error)

    def stop_and_settle(self) -> None:
        """Hold a moving arm, and wait until the board has acknowledged all frames."""
        if self.streamer:
            if self.streamer.playing:
                self.hold()
            self.streamer.wait_until_acknowledged()

    def close(self, error: HardwareError | None = None) -> None:
        """Close the port and wait for the threads that use it.

        Args:
            error: The fault that caused this, or None.
        """
        if self.streamer:
            self.streamer.close(error)
            _join(self.streamer.thread)
        self._closed = True
        try:
            self._link.close(discard=error is not None and not self._last_words)
        except Exception as failure:  # a driver may raise any exception
            logger.error("Closing the port %s failed: %s", self._link.port, failure)
        if self._reader:
            _join(self._reader)

    def _held_pose(self) -> tuple[float, ...]:
        """Return the pose that the board reports, or the start pose if it reports none [rad]."""
        held = self.session.boot_frame
        if held is None or held == self._robot.wire_format.encode(self._start_pose):
            return self._start_pose
        return self._robot.pose_of(held)

    def _read(self) -> None:
        """Read from the board until the link is closed or lost.

        A slow observer may delay this thread until the next connection has the port. Therefore the
        thread checks after every read that this connection is still open.
        """
        try:
            while not self._closed:
                data = self._link.read()
                if self._closed:
                    return
                if not data:
                    raise EOFError(f"a read ended while the port {self._link.port} was open")
                self._observe(BytesReceived(self._clock.now(), data))
                before = self.session.measured
                changed = self.session.receive(data, self._clock.now())
                if (measured := self.session.measured) and measured is not before:
                    now = self._clock.now()
                    self._observe(Measured(now, measured))
                    if self.streamer:  # after the activation
                        # Without torque a person moves the arm.
                        holds = self.guard.torque or self._moves_in
                        commanded = self.guard.commanded if holds else measured.position
                        follows = not self._moves_in
                        self._measured_guard.check(commanded, measured, now, follows=follows)
                if changed and self.streamer:
                    self.streamer.on_received()
                if changed:
                    self._on_receive()
        except BaseException as error:  # a driver may raise any exception
            self._fault(error)

    def _fault(self, error: BaseException) -> None:
        """Report an error, unless the connection is closed."""
        if not self._closed:
            self._on_fault(error)


def _join(thread: threading.Thread) -> None:
    """Wait for the end of another thread. A slow observer may delay that thread."""
    if thread is not threading.current_thread():
        thread.join(OBSERVER_TIMEOUT)
        if thread.is_alive():
            logger.warning("an observer of the arm delays its %s", thread.name)
