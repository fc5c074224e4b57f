"""Errors of the arm.

    HardwareError
    ├── DescriptionError          the robot file or its URDF is wrong
    ├── NoDriver                  the robot file names no driver, so the arm cannot move
    ├── LinkError                 the serial port
    │   ├── PortNotGiven          no port is configured
    │   ├── PortMissing           the port does not exist
    │   ├── PortDenied            no permission
    │   ├── PortBusy              another program has the port
    │   ├── PortLost              the port disappeared, or a write failed
    │   └── PortStalled           the other end accepts no more bytes
    ├── BoardError                the board misbehaves
    │   ├── BoardSilent           it did not report that it has booted
    │   ├── WrongFirmware         it runs another firmware than the robot file names
    │   ├── PoseOutsideLimits     it holds a servo outside the limits of its joint
    │   ├── BoardReset            it restarted while the arm was active
    │   └── FrameLost             it received other frames than were sent
    ├── DriverFailed              the driver raised another exception, or armtree has a bug
    ├── TransitionRefused         the lifecycle does not allow the transition now
    │   └── ActivationStopped     the arm was stopped while its board booted
    ├── CancelTimeout             the goal did not stop in time
    └── WriteRefused              the write guard refused; nothing was sent
        ├── NotActive             the arm is not active
        ├── InterfaceUnknown      the arm has no such command interface
        ├── InterfaceClaimed      another owner has claimed the joint
        ├── StaleGeneration       the motion was stopped
        ├── BadPosition           a position is missing, not finite or outside the limits
        ├── TooFast               the board cannot process the frame now
        └── JointTooFast          a joint would exceed its velocity limit

Every error has a stable `code`, and its message says what to do.
"""

from collections.abc import Sequence
from pathlib import Path


class HardwareError(Exception):
    """Base class of all errors of this package."""

    code = "hw.error"
    exit_status = 6
    meaning = "The arm failed"
    hint = "see the message"
    heading = ""


class DescriptionError(HardwareError):
    """The robot description is wrong.

    Attributes:
        path: The file.
        line: Line number, 0 if no line can be named.
    """

    code = "file.robot"
    exit_status = 3
    meaning = "The robot file or its URDF is wrong"
    hint = "correct it where the message says"

    def __init__(self, path: Path, line: int, message: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {message}" if line else f"{path}: {message}")


class NoDriver(HardwareError):
    """The robot file names no driver. The arm can be planned for but not moved.

    Attributes:
        path: The file.
    """

    code = "hw.no_driver"
    exit_status = 3
    meaning = "The robot file names no driver, so its arm cannot be moved"
    hint = "add a driver to the robot file, or only plan"

    def __init__(self, path: Path) -> None:
        self.path = path
        super().__init__(
            f"{path} names no driver, so this arm can be planned for but not moved, not even on "
            "the virtual board. To move it, add driver, [serial], and a wire for each joint; "
            "hardware/README.md explains them. `armtree plan`, `check` and `show` need no driver"
        )


class LinkError(HardwareError):
    """A serial port failed.

    Attributes:
        port: Name of the port, as the user gave it.
    """

    code = "hw.link"
    meaning = "The serial port failed"
    hint = "check the cable and the power"

    def __init__(self, port: str, message: str) -> None:
        self.port = port
        super().__init__(message)


class PortNotGiven(LinkError):
    """No port in the robot file, the environment or on the command line."""

    code = "hw.no_port"
    exit_status = 3
    meaning = "No serial port is configured"
    hint = "give --port, or ARMTREE_PORT"

    def __init__(self) -> None:
        super().__init__(
            "",
            "No serial port provided: give --port PORT, set ARMTREE_PORT, or write port under "
            "[serial] in the robot file (virtual needs no hardware)",
        )


class PortMissing(LinkError):
    """The port does not exist."""

    code = "hw.port_missing"
    meaning = "The serial port does not exist"
    hint = "`armtree doctor` lists the ports"

    def __init__(self, port: str, present: list[str]) -> None:
        there = ", ".join(present) or "none"
        super().__init__(
            port,
            f"There is no serial port {port}; present: {there}. "
            "Plug the board in, or give another --port (virtual needs no hardware)",
        )


class PortDenied(LinkError):
    """The user has no permission to open the port."""

    code = "hw.port_denied"
    meaning = "No permission to open the serial port"
    hint = "join its group"

    def __init__(self, port: str, group: str) -> None:
        super().__init__(
            port,
            f"No permission to open the port {port}. Join its group with "
            f"`sudo usermod -aG {group} $USER` and log in again",
        )


class PortBusy(LinkError):
    """Another program has the port."""

    code = "hw.port_busy"
    exit_status = 9
    meaning = "Another program has the serial port"
    hint = "end that program"

    def __init__(self, port: str, owner: str) -> None:
        super().__init__(port, f"The port {port} is in use by {owner}. End that program first")


class PortLost(LinkError):
    """The port disappeared while it was open. It is unknown which bytes the board received."""

    code = "hw.port_lost"
    meaning = "The serial port disappeared while it was open"
    hint = "check the cable, then configure and activate"

    def __init__(self, port: str, why: str) -> None:
        super().__init__(
            port,
            f"{why}: the port {port} is gone. Check the cable and the power, then run again",
        )


class PortStalled(LinkError):
    """A write did not finish in time. Its bytes may have arrived; they are never sent again."""

    code = "hw.port_stalled"
    meaning = "The board accepts no more bytes"
    hint = "check its power, then configure and activate"

    def __init__(self, port: str, why: str) -> None:
        super().__init__(
            port,
            f"{why}: the port {port} accepts no more bytes. Check the cable and the power of the "
            "board, then run again",
        )


class BoardError(HardwareError):
    """The board misbehaves."""

    code = "hw.board"
    meaning = "The board misbehaves"
    hint = "check the cable and its power"


class BoardSilent(BoardError):
    """The board did not report that it has booted."""

    code = "hw.board_silent"
    meaning = "The board did not report that it has booted"
    hint = "flash the firmware, or name the right one in the robot file"

    def __init__(self, port: str, firmware: str, seconds: float) -> None:
        super().__init__(
            f"The board on port {port} did not report within {seconds:g} s that it runs the "
            f"firmware {firmware}. Flash it, or name the board's firmware in the robot file; "
            "opening the port must reset the board"
        )


class WrongFirmware(BoardError):
    """The board runs another firmware than the robot file names."""

    code = "hw.wrong_firmware"
    meaning = "The board runs another firmware than the robot file names"
    hint = "correct the robot file"

    def __init__(self, runs: str, named: str, path: Path) -> None:
        super().__init__(
            f'The board runs {runs}, but the robot file names {named}. Write firmware = "{runs}" '
            f"under [serial] in {path}, or flash the board"
        )


class PoseOutsideLimits(BoardError):
    """The board holds a servo outside its joint's limits; the first frame would make it jump."""

    code = "hw.pose_outside"
    meaning = "The board holds a servo outside the limits of its joint"
    hint = "switch the board off and on"

    def __init__(self, joint: str, lower: float, upper: float, angle: int, nearest: int) -> None:
        super().__init__(
            f"The board holds the servo of {joint} at {angle} degrees. Its limits "
            f"[{lower:g}, {upper:g}] rad end at {nearest} degrees, and the first frame "
            "would make it jump there. Clear the space around the arm and switch the board off "
            "and on, so that it goes to its boot pose; or widen the limits in the URDF"
        )


class BoardReset(BoardError):
    """The board restarted, so its servos are no longer where armtree sent them."""

    code = "hw.board_reset"
    meaning = "The board restarted while the arm was active"
    hint = "check the power supply of the servos"

    def __init__(self, line: str) -> None:
        super().__init__(
            f"The board was reset while the arm was active; it sent {line!r}. Check the power "
            "supply of the servos (a voltage drop resets the board), then run again"
        )


class FrameLost(BoardError):
    """The board received other frames than were sent."""

    code = "hw.frame_lost"
    meaning = "The board received other frames than were sent"
    hint = "check the cable"

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}. Check the cable and the wires beside it, then run again")


class DriverFailed(HardwareError):
    """The driver of the arm raised an exception that is no HardwareError, or armtree has a bug.

    Attributes:
        __cause__: The exception.
    """

    code = "hw.driver"
    meaning = "The driver of the arm failed"
    hint = "fix the driver"

    def __init__(self, cause: BaseException) -> None:
        self.__cause__ = cause
        super().__init__(
            f"The driver failed: {cause!r}. It is unknown what the board received last. Fix the "
            "driver, or the cause that it names, then run again"
        )


def as_hardware_error(error: BaseException) -> HardwareError:
    """Return the error itself if it is a HardwareError, else DriverFailed with it as the cause."""
    return error if isinstance(error, HardwareError) else DriverFailed(error)


class TransitionRefused(HardwareError):
    """The lifecycle does not allow this transition now."""

    code = "hw.transition_refused"
    meaning = "The arm's lifecycle does not allow that now"
    hint = "the message lists what it allows"


class ActivationStopped(TransitionRefused):
    """The arm was stopped while its board booted. It is inactive."""

    code = "hw.activation_stopped"
    meaning = "The arm was stopped while its board booted"
    hint = "activate it again"


class CancelTimeout(HardwareError):
    """A goal did not stop in time, so the arm left *active*."""

    code = "hw.cancel_timeout"
    meaning = "The goal did not stop in time, so the arm left *active*"
    hint = "fix the skill that the message names, then configure and activate"


class WriteRefused(HardwareError):
    """The write guard refused; nothing was sent."""

    code = "hw.refused"
    meaning = "The write guard refused; nothing was sent"


class NotActive(WriteRefused):
    """The arm is not active, so nothing may be written to it."""

    code = "hw.not_active"
    meaning = "The arm is not active, so nothing may be written to it"
    hint = (
        "`armtree arm configure` if it is unconfigured, then `armtree arm activate`; if it is "
        "finalized, start armtree again"
    )


class InterfaceUnknown(WriteRefused):
    """The arm has no such command interface."""

    code = "hw.no_interface"
    meaning = "The arm has no such command interface"
    hint = "the message lists the existing ones"

    def __init__(self, name: str, present: Sequence[str]) -> None:
        super().__init__(f"there is no command interface {name}; there are {', '.join(present)}")


class InterfaceClaimed(WriteRefused):
    """Another owner has claimed the joint."""

    code = "hw.claimed"
    meaning = "Another owner has claimed the joint"
    hint = "stop the arm first"

    def __init__(self, name: str, owner: str, other: str) -> None:
        super().__init__(
            f"{name} is claimed by {owner}, so {other} cannot command it; stop the arm first"
        )


class StaleGeneration(WriteRefused):
    """The motion was stopped, so it may not write."""

    code = "hw.stale"
    meaning = "The motion was stopped, so it may not write"
    hint = "run again"


class BadPosition(WriteRefused, ValueError):
    """A joint position is missing, not finite or outside its limits.

    Attributes:
        joint: Name of the joint, or "" if none can be named.
        value: The position that was given [rad].
        limit: The limit that it exceeds [rad], or None if the value is no finite number.
    """

    code = "hw.bad_position"
    meaning = "A joint position is missing, not finite or outside its limits"
    hint = "choose a position within the limits"

    def __init__(
        self, message: str, joint: str = "", value: object = None, limit: float | None = None
    ) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(message)


class TooFast(WriteRefused):
    """The board cannot process a frame: it comes too early, or a servo moves too far."""

    code = "hw.too_fast"
    meaning = "The board cannot process the frame"
    hint = "lower the velocity in the robot file"


class JointTooFast(WriteRefused):
    """A joint would move faster than its velocity limit.

    Attributes:
        joint: Name of the joint.
        value: Its velocity [rad/s].
        limit: Its velocity limit [rad/s].
    """

    code = "hw.joint_too_fast"
    meaning = "A joint would move faster than its velocity limit"
    hint = "report it, with the recording; the planner must keep the limits of the robot file"

    def __init__(self, joint: str, value: float, limit: float, scale: float, unit: str) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(
            f"{joint} would move at {scale * value:.4g} {unit}/s; its limit is "
            f"{scale * limit:.4g} {unit}/s"
        )
