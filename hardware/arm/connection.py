"""An open line to a board: from an activation to its end."""

import logging
import threading
from collections.abc import Callable

from hardware.clock import Clock
from hardware.description.robot import Robot
from hardware.errors import BoardSilent, FrameLost, HardwareError, NotActive, PoseOutsideLimits
from hardware.link.link import Link

from .acknowledgements import Acknowledgements
from .events import PATIENCE, BytesReceived, Observer
from .streamer import Streamer
from .write_guard import WriteGuard

logger = logging.getLogger(__name__)


class Connection:
    """The line, the thread that listens on it, and, once the board has booted, what may write.

    Args:
        robot: Whose board.
        link: The line to it.
        clock: Whose time.
        observe: Told of every byte in both directions.
        active: Tells whether the lifecycle stands in *active*.
        fault: Told what fails, from any thread.
        heard: Called whenever the board has said something.

    Attributes:
        dialogue: What the board said.
        door: Through which it is written to; None until `start`.
        streamer: What plays motions; None until `start`.
    """

    def __init__(
        self,
        robot: Robot,
        link: Link,
        clock: Clock,
        observe: Observer,
        active: Callable[[], bool],
        fault: Callable[[BaseException], None],
        heard: Callable[[], None],
    ) -> None:
        self._robot, self._link, self._clock = robot, link, clock
        self._observe, self._active = observe, active
        self._report, self._heard = fault, heard
        self._closed = False
        self._listener: threading.Thread | None = None
        self.dialogue = Acknowledgements(robot)
        self.door: WriteGuard | None = None
        self.streamer: Streamer | None = None

    def open(self) -> None:
        """Open the port, which resets the board, and listen.

        Raises:
            LinkError: The port cannot be had.
        """
        self._link.open()
        self._listener = self._clock.spawn(self._listen, "listener")

    def start(self, start_pose: tuple[float, ...]) -> None:
        """Prepare to write, once the board has booted.

        Args:
            start_pose: Pose of the arm, unless the board reports another one; one value per
                actuated joint [rad].

        Raises:
            BoardSilent: It did not say what its firmware says when it has booted.
            PoseOutsideLimits: It holds what is outside a joint's limits.
        """
        robot, dialogue = self._robot, self.dialogue
        if robot.firmware.banner and not dialogue.holds:
            raise BoardSilent(self._link.port, robot.firmware.name, robot.serial.boot_wait)
        pose = self._held_pose(start_pose)
        self.door = WriteGuard(
            robot, self._link, self._clock, self._active, self._observe, dialogue, pose
        )
        period = 1 / robot.firmware.rate
        self.streamer = Streamer(self.door, dialogue, self._clock, period, self._fault)

    def greet(self) -> None:
        """Ask a board that has booted to acknowledge frames, if it can."""
        try:
            if self.door:
                self.door.greet()
        except NotActive:
            return  # a fault came first
        except Exception as error:  # a driver may raise what it likes
            self._fault(error)

    def hold(self, brake: float = 0.0) -> None:
        """Drop what is left of a motion and hold.

        Args:
            brake: How long to slow down before [s].
        """
        try:
            if self.streamer:
                self.streamer.stop(brake)
        except Exception as error:  # a driver may raise what it likes
            self._fault(error)

    def stop_and_settle(self) -> None:
        """Hold what moves, and wait until the board has answered."""
        if not self.streamer:
            return
        if self.streamer.playing:
            self.hold()
        try:
            self.streamer.settle()
        except FrameLost as error:
            self._fault(error)

    def close(self, error: HardwareError | None = None) -> None:
        """Close the port and wait for the threads that used it.

        Args:
            error: Why, where a fault is the reason.
        """
        if self.streamer:
            self.streamer.close(error)
            _join(self.streamer.thread)
        self._closed = True
        try:
            self._link.close(discard=error is not None)
        except Exception as failure:  # a driver may raise what it likes
            logger.error("Closing the port %s failed: %s", self._link.port, failure)
        if self._listener:
            _join(self._listener)

    def _held_pose(self, start_pose: tuple[float, ...]) -> tuple[float, ...]:
        """Pose that the board reports [rad], or the start pose if it reports none."""
        robot, held = self._robot, self.dialogue.holds
        wire_format = robot.wire_format
        if held is None or held == wire_format.encode(start_pose):
            return start_pose
        pose = wire_format.decode(held)  # inside the limits, whatever is held
        nearest = wire_format.encode(pose).servos
        for joint, angle, near in zip(robot.actuated, held.servos, nearest, strict=True):
            if angle != near:
                raise PoseOutsideLimits(joint.name, joint.lower, joint.upper, angle, near)
        return pose

    def _listen(self) -> None:
        """Read what the board says until the link is closed or lost.

        An observer may have kept this thread for so long that the port is the next one's by now.
        """
        try:
            while not self._closed:
                data = self._link.read()
                if self._closed:
                    return
                if not data:
                    raise EOFError(f"its read ended while the port {self._link.port} was open")
                self._observe(BytesReceived(self._clock.now(), data))
                self.dialogue.hear(data)
                if self.streamer:
                    self.streamer.heard()
                self._heard()
        except BaseException as error:  # a driver may raise what it likes
            self._fault(error)

    def _fault(self, error: BaseException) -> None:
        """Report what failed; nobody wants to know of a connection that has ended."""
        if not self._closed:
            self._report(error)


def _join(thread: threading.Thread) -> None:
    """Wait until a thread has ended, unless it is the caller, or an observer keeps it for long."""
    if thread is not threading.current_thread():
        thread.join(PATIENCE)
        if thread.is_alive():
            logger.warning("an observer of the arm keeps its %s for long", thread.name)
