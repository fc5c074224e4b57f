"""Errors of the arm.

The base class is HardwareError. LinkError concerns the serial port. BoardError concerns the board.
WriteRefused concerns a frame that the write guard did not send. `drivers/servo_errors.py` has the
errors of servos on a bus. Every error has a stable `code`, and its message says what to do.
"""

import errno
import math
import os
from pathlib import Path
from typing import Any, ClassVar

# End of the hint of a fault. `armtree run` replaces it, because its next run activates the arm.
ACTIVATE_AGAIN = "configure and activate"

_LIMITS = {errno.EMFILE: "`ulimit -n`", errno.EFBIG: "`ulimit -f`", errno.ENOMEM: "`ulimit -v`"}
_NO_THREAD = "can't start new thread"  # message of the interpreter


class ArmtreeError(Exception):
    """armtree failed. Base class of all errors of armtree.

    Attributes:
        code: Stable name of the cause.
        exit_status: Exit status of a command that ends with this error.
        http_status: HTTP status of the answer to a request that fails with this error.
        hint: Advice for the user.
        heading: Text that output puts before the message; empty for no text.
        by_code: Loaded error classes that define a code, by this code.
    """

    code = "internal"
    exit_status = 1
    http_status = 409
    hint = ""
    heading = ""
    by_code: ClassVar[dict[str, type["ArmtreeError"]]] = {}

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if "code" in vars(cls):
            cls.by_code.setdefault(cls.code, cls)


class InternalError(ArmtreeError):
    """A bug in armtree."""

    code = ArmtreeError.code
    http_status = 500
    hint = "report this bug, with the output of --debug and the recording"
    heading = "A bug in armtree"


class HostLimit(ArmtreeError):
    """A limit of the operating system is too low.

    Args:
        words: Description of the failure, for the message.
        option: Command that raises the limit, such as `ulimit -n 1024`.
    """

    code = "host.limit"
    exit_status = 3
    hint = "raise the limit that the message names, then run again"

    def __init__(self, words: str, option: str) -> None:
        self.hint = f"raise the limit ({option}), then run again"
        super().__init__(f"{words}; {self.hint}")


def host_limit(error: BaseException) -> HostLimit | None:
    """Return the error for a limit of the operating system; None if an error has other causes.

    Args:
        error: An error of a system call, or of the start of a thread.
    """
    option, words = "", str(error)
    if isinstance(error, MemoryError):
        option, words = _LIMITS[errno.ENOMEM], "No memory is left"
    elif isinstance(error, RuntimeError) and words == _NO_THREAD:
        option = "`ulimit -u`, `-v` or `-d`"
    elif isinstance(error, OSError) and error.errno in _LIMITS:
        option = _LIMITS[error.errno]
    return HostLimit(words, option) if option else None


class HardwareError(ArmtreeError):
    """The arm failed. Base class of the errors of this package."""

    code = "hw.error"
    exit_status = 6
    hint = "`armtree doctor` checks the arm; after that, `armtree arm activate`"


class DescriptionError(HardwareError):
    """The robot file or its URDF is wrong.

    Attributes:
        path: The file.
        line: Line number; 0 if unknown.
    """

    code = "file.robot"
    exit_status = 3
    http_status = 422
    hint = "correct that file, or give another one with --robot"

    def __init__(self, path: Path, line: int, message: str) -> None:
        self.path, self.line = path, line
        super().__init__(f"{path}:{line}: {message}" if line else f"{path}: {message}")


class NoDriver(HardwareError):
    """The robot file names no driver. The arm moves on the port `virtual` only.

    Attributes:
        path: The robot file.
    """

    code = "hw.no_driver"
    exit_status = 3
    hint = "add a driver to the robot file, or use --port virtual"

    def __init__(self, path: Path, port: str) -> None:
        self.path = path
        super().__init__(
            f"{path} names no driver, so nothing can be sent to the port {port}. Add driver, "
            "[serial], and a wire for each joint; the page *Robot files* explains them. Without a "
            "driver the arm moves on the port virtual only, and nothing real moves"
        )


class NotAble(HardwareError):
    """The board of the arm cannot do what a command needs."""

    code = "hw.not_able"
    exit_status = 3
    hint = "use an arm with another board: `--robot`"

    def __init__(self, robot: str, firmware: str, ability: str) -> None:
        super().__init__(
            f"The board of {robot}, with the firmware {firmware}, cannot {ability}. Use an arm "
            "whose board can, for example `--robot so101`; see the page *Bus servos by Feetech*"
        )


class LinkError(HardwareError):
    """The serial port failed.

    Attributes:
        port: Name of the port, as the user gave it.
    """

    code = "hw.link"
    hint = "check the cable and the power"

    def __init__(self, port: str, message: str) -> None:
        self.port = port
        super().__init__(message)


class PortNotGiven(LinkError):
    """No serial port is configured."""

    code = "hw.no_port"
    exit_status = 3
    hint = "give --port, or ARMTREE_PORT"

    def __init__(self) -> None:
        super().__init__(
            "",
            "No serial port provided: give --port PORT, set ARMTREE_PORT, or write port under "
            "[serial] in the robot file (virtual needs no hardware)",
        )


class PortMissing(LinkError):
    """The serial port does not exist."""

    code = "hw.port_missing"
    hint = "`armtree doctor` lists the ports"

    def __init__(self, port: str, present: list[str]) -> None:
        there = ", ".join(present) or "none"
        super().__init__(
            port,
            f"There is no serial port {port}; present: {there}. "
            "Plug the board in, or give another port (virtual needs no hardware)",
        )


class PortDenied(LinkError):
    """The user has no permission to open the serial port."""

    code = "hw.port_denied"
    hint = "join the group that owns the port, then log in again"

    def __init__(self, port: str, group: str) -> None:
        super().__init__(
            port,
            f"No permission to open the port {port}. Join its group with "
            f"`sudo usermod -aG {group} $USER` and log in again",
        )


class PortBusy(LinkError):
    """Another program, or another arm of this program, uses the serial port."""

    code = "hw.port_busy"
    exit_status = 9
    hint = "end that program"

    def __init__(self, port: str, owner: int | None) -> None:
        who = "another program" if owner is None else f"the program with process id {owner}"
        advice = "End that program first"
        if owner == os.getpid():
            who, self.hint = f"this program, process id {owner}", "close the arm on this port"
            advice = (
                "Close the arm on this port. If a write to the port does not return, unplug the "
                "board and plug it in again, then try again"
            )
        super().__init__(port, f"The port {port} is in use by {who}. {advice}")


class PortLost(LinkError):
    """The serial port disappeared while it was open. The last bytes may be lost."""

    code = "hw.port_lost"
    hint = f"check the cable, then {ACTIVATE_AGAIN}"

    def __init__(self, port: str, why: str) -> None:
        super().__init__(port, f"{why}: the port {port} is gone. Check the cable and the power")


class PortStalled(LinkError):
    """The board accepts no more bytes. Unwritten bytes are never sent again."""

    code = "hw.port_stalled"
    hint = f"check the power of the board, then {ACTIVATE_AGAIN}"

    def __init__(self, port: str, why: str, busy: str = "") -> None:
        super().__init__(
            port,
            f"{why}: the port {port} accepts no more bytes. Check the cable and the power of the "
            f"board{busy}",
        )


class BoardError(HardwareError):
    """Something is wrong with the board or with a servo."""

    code = "hw.board"
    hint = "check the cable and the power of the board"


class BoardSilent(BoardError):
    """The board did not send a report that the arm needs before it moves."""

    code = "hw.board_silent"
    hint = "check power and cable of the board, and the firmware in the robot file"

    def __init__(self, port: str, seconds: float, what: str, advice: str) -> None:
        super().__init__(
            f"Within {seconds:g} s, the board on port {port} did not report {what}. {advice}"
        )


class WrongFirmware(BoardError):
    """The board does not run the firmware that the robot file names."""

    code = "hw.wrong_firmware"
    hint = "correct the robot file"

    def __init__(self, runs: str, named: str, path: Path) -> None:
        super().__init__(
            f'The board runs {runs}, but the robot file names {named}. Write firmware = "{runs}" '
            f"under [serial] in {path}, or flash the board"
        )


class PoseOutsideLimits(BoardError):
    """A servo is outside the limits of its joint, and would jump at the first frame."""

    code = "hw.pose_outside"
    hint = "move the joint inside its limits, as the message says"

    def __init__(self, joint: str, place: str, limit: str, advice: str) -> None:
        super().__init__(
            f"The servo of {joint} is at {place}, outside the limits of the joint, which end at "
            f"{limit}. A motion would begin with a jump. First {advice}; or widen the limits in "
            "the URDF"
        )


class BoardReset(BoardError):
    """The board restarted while the arm was active. Its servos may have moved."""

    code = "hw.board_reset"
    hint = "check the power supply of the servos"

    def __init__(self, line: str) -> None:
        super().__init__(
            f"The board was reset while the arm was active; it sent {line!r}. Check the power "
            "supply of the servos (a voltage drop resets the board), then run again"
        )


class FrameLost(BoardError):
    """The board did not acknowledge a frame in time, or received other frames than were sent."""

    code = "hw.frame_lost"
    hint = "check the cable"

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}. Check the cable and the wires beside it, then run again")


class MeasuredFault(BoardError):
    """A measured value is beyond its limit.

    Attributes:
        joint: Name of the joint.
        value: Value beyond the limit: a distance [rad], an effort, a temperature or a voltage.
        limit: Limit of the value, in the same unit.
    """

    def __init__(
        self, joint: str, value: float, limit: float, message: str, effect: str = ""
    ) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(f"{message}. {effect}" if effect else message)


class JointNotFollowing(MeasuredFault):
    """A joint is too far from its commanded position."""

    code = "hw.not_following"
    hint = f"free the joint and check its servo, then {ACTIVATE_AGAIN}"

    def __init__(
        self, joint: str, commanded: float, measured: float, limit: float, effect: str
    ) -> None:
        error = abs(commanded - measured)
        super().__init__(
            joint,
            math.radians(error),
            math.radians(limit),
            f"{joint} is commanded to {commanded:.1f} deg and measured at {measured:.1f} deg: "
            f"{error:.1f} deg apart; the limit is {limit:g} deg (following_deg). Free the joint, "
            "or move more slowly",
            effect,
        )


class JointStalled(MeasuredFault):
    """A joint pushes with its full effort and does not reach its commanded position."""

    code = "hw.stalled"
    hint = f"free the joint, then {ACTIVATE_AGAIN}"

    def __init__(
        self, joint: str, effort: float, limit: float, error: float, effect: str, opens: bool
    ) -> None:
        advice = ", or lift less"
        if opens:  # a joint of the gripper, in the direction in which it does not grip
            advice = ". If the gripper grips with this motion, change grips in the robot file"
        super().__init__(
            joint,
            effort,
            limit,
            f"{joint} pushes with {effort:.0%} of its torque, {error:.1f} deg from its commanded "
            f"position; the limit is {limit:.0%} (stall_effort). Free the joint{advice}",
            effect,
        )


class NotArrived(MeasuredFault):
    """A joint did not reach the end of a motion. The arm stays active."""

    code = "hw.not_arrived"
    hint = "free the joint, or raise settle_deg in the robot file"

    def __init__(
        self, joint: str, goal: float, measured: float, limit: float, seconds: float
    ) -> None:
        error = abs(goal - measured)
        super().__init__(
            joint,
            math.radians(error),
            math.radians(limit),
            f"{joint} moved towards {goal:.1f} deg and is measured at {measured:.1f} deg, "
            f"{seconds:g} s after the last frame: {error:.1f} deg apart; the limit is {limit:g} "
            "deg (settle_deg). Free the joint, lift less, or raise the limit",
        )


class ServoTooHot(MeasuredFault):
    """A servo is too hot."""

    code = "hw.servo_hot"
    hint = f"let the servo cool down, then {ACTIVATE_AGAIN}"

    def __init__(self, joint: str, celsius: float, limit: float, effect: str) -> None:
        words = f"The servo of {joint} has {celsius:g} degrees Celsius; the limit is {limit:g} "
        super().__init__(joint, celsius, limit, f"{words}(most_c). Let it cool down", effect)


class SupplyTooLow(MeasuredFault):
    """The supply of a servo has too low a voltage."""

    code = "hw.voltage_low"
    hint = f"use a stronger supply, then {ACTIVATE_AGAIN}"

    def __init__(self, joint: str, volts: float, limit: float, effect: str) -> None:
        words = f"The servo of {joint} has {volts:g} V; the limit is {limit:g} V (least_v). Use a "
        words += "stronger supply, or shorter cables"
        super().__init__(joint, volts, limit, words, effect)


class DriverFailed(HardwareError):
    """The driver of the arm raised an exception other than a HardwareError.

    Attributes:
        __cause__: The exception.
    """

    code = "hw.driver"
    hint = "fix the driver"

    def __init__(self, cause: BaseException) -> None:
        self.__cause__ = cause
        way = "Fix the driver or the named cause, then run again"
        if limit := host_limit(cause):
            self.hint = limit.hint
            way = f"{self.hint[0].upper()}{self.hint[1:]}"
        super().__init__(
            f"The driver failed: {cause!r}. The board may not have received the last frame. {way}"
        )


def as_hardware_error(error: BaseException) -> HardwareError:
    """Return the error if it is a HardwareError, else a DriverFailed with this error as cause."""
    return error if isinstance(error, HardwareError) else DriverFailed(error)


class TransitionRefused(HardwareError):
    """The lifecycle of the arm does not allow this transition now."""

    code = "hw.transition_refused"
    hint = "request a transition that the message lists"

    def __init__(self, why: str, hint: str | None = None) -> None:
        super().__init__(why)
        self.hint = hint or self.hint


class ActivationStopped(TransitionRefused):
    """The arm was stopped while its board booted, or while its joints moved to their limits."""

    code = "hw.activation_stopped"
    hint = "activate the arm again"


class CancelTimeout(HardwareError):
    """A goal did not stop in time, so the arm is no longer active."""

    code = "hw.cancel_timeout"
    hint = f"fix the skill that the message names, then {ACTIVATE_AGAIN}"


class WriteRefused(HardwareError):
    """The write guard refused a frame and sent nothing."""

    code = "hw.refused"
    hint = "nothing was sent; start a new goal"


class NotActive(WriteRefused):
    """The arm is not active, so it accepts no commands."""

    code = "hw.not_active"
    hint = (
        "`armtree arm configure` if it is unconfigured, then `armtree arm activate`; if it is "
        "finalized, start armtree again"
    )

    def __init__(self, message: str, hint: str = hint) -> None:
        super().__init__(message)
        self.hint = hint


class ArmClaimed(WriteRefused):
    """Another motion already commands the arm."""

    code = "hw.claimed"
    hint = "stop the arm first"

    def __init__(self, owner: str, other: str) -> None:
        super().__init__(
            f"the arm is claimed by {owner}, so {other} cannot command it; stop the arm first"
        )


class StaleGeneration(WriteRefused):
    """The motion was stopped, or the arm moved since it was planned. It may not send frames."""

    code = "hw.stale"
    hint = "run again"


class TorqueOff(WriteRefused):
    """The servos have no torque, so the arm cannot move."""

    code = "hw.torque_off"
    hint = "switch the torque on, or deactivate and activate the arm"

    def __init__(self) -> None:
        super().__init__(
            "the torque of the servos is off, so the arm cannot move; switch it on, or deactivate "
            "and activate the arm"
        )


class BadPosition(WriteRefused, ValueError):
    """A joint position is missing, not finite or outside its limits.

    Attributes:
        joint: Name of the joint; empty if unknown.
        value: The position [rad].
        limit: The exceeded limit [rad]; None if the value is not a finite number.
    """

    code = "hw.bad_position"
    hint = "choose a position within the limits"

    def __init__(
        self, message: str, joint: str = "", value: object = None, limit: float | None = None
    ) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(message)


class TooFast(WriteRefused):
    """The board cannot process a frame: it comes too early, or turns the servos too far."""

    code = "hw.too_fast"
    hint = "lower the velocity in the robot file"


class ScheduleTooLong(WriteRefused):
    """A motion of the whole arm would take too long.

    Attributes:
        value: Duration of the motion [s].
        limit: Largest duration [s].
    """

    code = "hw.too_long"
    hint = "split the motion into shorter ones, or raise the velocities in the robot file"

    def __init__(self, value: float, limit: float) -> None:
        self.value, self.limit = value, limit
        super().__init__(f"the motion would take {value:.6g} s; the limit is {limit:g} s")


class JointTooFast(WriteRefused):
    """A joint would move faster than its velocity limit.

    Attributes:
        joint: Name of the joint.
        value: Planned velocity of the joint [rad/s].
        limit: Velocity limit of the joint [rad/s].
    """

    code = "hw.joint_too_fast"
    hint = "report this bug with the recording: the planner must keep the limits of the robot file"

    def __init__(self, joint: str, value: float, limit: float, scale: float, unit: str) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(
            f"{joint} would move at {scale * value:.4g} {unit}/s; its limit is "
            f"{scale * limit:.4g} {unit}/s"
        )
