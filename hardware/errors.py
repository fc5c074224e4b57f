"""What can go wrong with the arm.

    HardwareError
    ├── DescriptionError          the robot file or its URDF is wrong
    ├── NoDriver                  the robot file names no driver, so nothing can be moved
    ├── LinkError                 the serial port
    │   ├── PortNotGiven          nobody said which
    │   ├── PortMissing           there is no such port
    │   ├── PortDenied            no permission
    │   ├── PortBusy              somebody else has it
    │   ├── PortLost              it went away, or a write failed half-way
    │   └── PortStalled           the other end stopped taking bytes
    ├── BoardError                what the board says, or keeps to itself
    │   ├── BoardSilent           it did not say that it has booted
    │   ├── WrongFirmware         it says that it runs another one than the robot file names
    │   ├── PoseOutsideLimits     it holds what the arm must never be sent
    │   ├── BoardReset            it started anew while the arm was active
    │   └── FrameLost             it took other frames than were sent
    ├── DriverFailed              what is no error of ours came out of the driver, or a bug of ours
    ├── TransitionRefused         the lifecycle does not allow it now
    │   └── ActivationStopped     somebody stopped the arm while its board booted
    ├── CancelTimeout             what drove the arm did not stop in time
    └── WriteRefused              the write guard said no; nothing was sent
        ├── NotActive             only an active arm may be written to
        ├── InterfaceUnknown      the arm has no such command interface
        ├── InterfaceClaimed      somebody else commands that joint
        ├── StaleGeneration       the motion was stopped meanwhile
        ├── BadPosition           not finite, missing or outside the limits
        └── TooFast               more than the board can digest

Every error carries a stable `code`, and its message says what to do next.
"""

from collections.abc import Sequence
from pathlib import Path


class HardwareError(Exception):
    """Root of everything this room raises."""

    code = "hw.error"
    exit_status = 6
    meaning = "The arm failed"
    hint = "see the message"
    heading = ""


class DescriptionError(HardwareError):
    """The robot description is wrong.

    Attributes:
        path: The file.
        line: Line number, 0 where no line can be named.
    """

    code = "file.robot"
    exit_status = 3
    meaning = "The robot file or its URDF is wrong"
    hint = "correct it where the message says"

    def __init__(self, path: Path, line: int, message: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {message}" if line else f"{path}: {message}")


class NoDriver(HardwareError):
    """The robot file names no driver: its arm can be planned for, and not moved.

    Attributes:
        path: The file.
    """

    code = "hw.no_driver"
    exit_status = 3
    meaning = "The robot file names no driver, so its arm cannot be moved"
    hint = "write one, or plan only"

    def __init__(self, path: Path) -> None:
        self.path = path
        super().__init__(
            f"{path} names no driver, so this arm can be planned for and not moved, not by a "
            "virtual board either. To move it write driver, [serial], and a wire for each joint; "
            "hardware/README.md explains them. `armtree plan`, `check` and `show` do without"
        )


class LinkError(HardwareError):
    """A serial port failed.

    Attributes:
        port: The port's name as it was given.
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
    meaning = "Nobody said which serial port"
    hint = "give --port, or ARMTREE_PORT"

    def __init__(self) -> None:
        super().__init__(
            "",
            "No serial port provided: give --port PORT, set ARMTREE_PORT, or write port under "
            "[serial] in the robot file (virtual needs no hardware)",
        )


class PortMissing(LinkError):
    """There is no such port."""

    code = "hw.port_missing"
    meaning = "There is no such serial port"
    hint = "`armtree doctor` shows those there are"

    def __init__(self, port: str, present: list[str]) -> None:
        there = ", ".join(present) or "none"
        super().__init__(
            port,
            f"There is no serial port {port}; present: {there}. "
            "Plug the board in, or give another --port (virtual needs no hardware)",
        )


class PortDenied(LinkError):
    """The port is there, but not for this user."""

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
    """The port went away while it was open; what the board got last is unknown."""

    code = "hw.port_lost"
    meaning = "The serial port went away while it was open"
    hint = "check the cable, then configure and activate"

    def __init__(self, port: str, why: str) -> None:
        super().__init__(
            port,
            f"{why}: the port {port} is gone. Check the cable and the power, then run again",
        )


class PortStalled(LinkError):
    """A write did not finish in time; it may or may not have arrived, and is never repeated."""

    code = "hw.port_stalled"
    meaning = "The board takes no more bytes"
    hint = "check its power, then configure and activate"

    def __init__(self, port: str, why: str) -> None:
        super().__init__(
            port,
            f"{why}: the port {port} takes no more bytes. Check the cable and the power of the "
            "board, then run again",
        )


class BoardError(HardwareError):
    """The board does not do what it was told."""

    code = "hw.board"
    meaning = "The board does not do what it was told"
    hint = "check the cable and its power"


class BoardSilent(BoardError):
    """The board did not say that it has booted."""

    code = "hw.board_silent"
    meaning = "The board did not say that it has booted"
    hint = "flash it, or name what it runs"

    def __init__(self, port: str, firmware: str, seconds: float) -> None:
        super().__init__(
            f"The board on port {port} did not say within {seconds:g} s that it runs the firmware "
            f"{firmware}. Flash it, or name in the robot file what the board runs; opening the "
            "port must reset it"
        )


class WrongFirmware(BoardError):
    """The board says that it runs another firmware than the robot file names."""

    code = "hw.wrong_firmware"
    meaning = "The board runs another firmware than the robot file names"
    hint = "correct the robot file"

    def __init__(self, runs: str, named: str, path: Path) -> None:
        super().__init__(
            f'The board runs {runs}, but the robot file names {named}. Write firmware = "{runs}" '
            f"under [serial] in {path}, or flash the board"
        )


class PoseOutsideLimits(BoardError):
    """The board holds what is outside a joint's limits, so the first frame would make it jump."""

    code = "hw.pose_outside"
    meaning = "The board holds what is outside a joint's limits"
    hint = "switch the board off and on"

    def __init__(self, joint: str, lower: float, upper: float, angle: int, nearest: int) -> None:
        super().__init__(
            f"The board holds the servo of {joint} at {angle} degrees. Its limits "
            f"[{lower:g}, {upper:g}] rad end at {nearest} degrees, and the first frame "
            "would make it jump there. Clear the space around the arm and switch the board off "
            "and on, so that it goes to its boot pose; or widen the limits in the URDF"
        )


class BoardReset(BoardError):
    """The board started anew, so where its servos go nobody commanded."""

    code = "hw.board_reset"
    meaning = "The board started anew while the arm was active"
    hint = "check the servos' supply"

    def __init__(self, line: str) -> None:
        super().__init__(
            f"The board was reset while the arm was active; it says {line!r}. Check the servos' "
            "supply (a dip resets the board), then run again"
        )


class FrameLost(BoardError):
    """The board took other frames than were sent."""

    code = "hw.frame_lost"
    meaning = "The board took other frames than were sent"
    hint = "check the cable"

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}. Check the cable and what runs beside it, then run again")


class DriverFailed(HardwareError):
    """What is no HardwareError came out of the driver of the arm, or out of a bug of ours.

    Attributes:
        __cause__: What it was.
    """

    code = "hw.driver"
    meaning = "The driver of the arm failed"
    hint = "mend the driver"

    def __init__(self, cause: BaseException) -> None:
        self.__cause__ = cause
        super().__init__(
            f"The driver failed: {cause!r}. What the board got last is unknown. Mend the driver, "
            "or the cause that it names, then run again"
        )


def ours(error: BaseException) -> HardwareError:
    """An error of ours, whatever came out of a driver."""
    return error if isinstance(error, HardwareError) else DriverFailed(error)


class TransitionRefused(HardwareError):
    """The lifecycle allows no such transition now."""

    code = "hw.transition_refused"
    meaning = "The arm's lifecycle does not allow that now"
    hint = "the message lists what it allows"


class ActivationStopped(TransitionRefused):
    """Somebody stopped the arm while its board booted; it is inactive."""

    code = "hw.activation_stopped"
    meaning = "Somebody stopped the arm while its board booted"
    hint = "activate it again"


class CancelTimeout(HardwareError):
    """What drove the arm was asked to stop and did not in time, so the arm left *active*."""

    code = "hw.cancel_timeout"
    meaning = "What drove the arm did not stop in time, so the arm left *active*"
    hint = "mend the skill that is named, then configure and activate"


class WriteRefused(HardwareError):
    """The write guard refused; nothing was sent."""

    code = "hw.refused"
    meaning = "The guard in front of the wire refused; nothing was sent"


class NotActive(WriteRefused):
    """Only an active arm may be written to."""

    code = "hw.not_active"
    meaning = "Only an active arm may be written to"
    hint = (
        "`armtree arm configure` where it is unconfigured, then `armtree arm activate`; where it "
        "is finalized, start armtree again"
    )


class InterfaceUnknown(WriteRefused):
    """The arm has no such command interface."""

    code = "hw.no_interface"
    meaning = "The arm has no such command interface"
    hint = "the message lists those there are"

    def __init__(self, name: str, present: Sequence[str]) -> None:
        super().__init__(f"there is no command interface {name}; there are {', '.join(present)}")


class InterfaceClaimed(WriteRefused):
    """Somebody else commands that joint."""

    code = "hw.claimed"
    meaning = "Somebody else commands that joint"
    hint = "stop the arm first"

    def __init__(self, name: str, owner: str, other: str) -> None:
        super().__init__(
            f"{name} is claimed by {owner}, so {other} cannot command it; stop the arm first"
        )


class StaleGeneration(WriteRefused):
    """The motion that wants to write was stopped."""

    code = "hw.stale"
    meaning = "The motion that wants to write was stopped"
    hint = "run again"


class BadPosition(WriteRefused, ValueError):
    """A joint value is missing, not finite or outside its limits.

    Attributes:
        joint: Which; empty where none can be named.
        value: What was given for it [rad].
        limit: What it is held against [rad]; None where the value is no finite number.
    """

    code = "hw.bad_position"
    meaning = "A joint value is missing, not finite or outside its limits"
    hint = "choose one within"

    def __init__(
        self, message: str, joint: str = "", value: object = None, limit: float | None = None
    ) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(message)


class TooFast(WriteRefused):
    """The board could not digest this: a frame that is too early or too far, or a jump."""

    code = "hw.too_fast"
    meaning = "More than the board can digest"
    hint = "lower the velocity in the robot file"
