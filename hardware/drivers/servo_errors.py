"""Errors of servos on a bus.

BoardError
├── BoardSilent
│   ├── NoServos              the answers on the port are not from servos
│   └── ServoMissing          a servo does not answer before the arm may move
├── ServoTwice                two servos have one id
├── ServoSilent               servos stopped answering
├── ServoFault                a servo reports an error
├── TorqueLost                a servo lost its torque
├── CalibrationDiffers        stored values of a servo differ from the calibration file
├── WrongMode                 a servo does not move to positions
├── SeamInside                a joint passes the seam of its servo's turn
├── NotKept                   a servo does not store a written value
└── NotReleased               a servo still has torque after it was switched off

CalibrationMissing is a HardwareError: the arm must be calibrated before it moves.
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from hardware.errors import ACTIVATE_AGAIN, BoardError, BoardSilent, HardwareError
from hardware.link.host_load import or_busy
from hardware.loading.dataclass import dataclass
from hardware.printable import plural

_DOCTOR = "`armtree doctor --open` shows what is on the bus"


def _clues(twice: Iterable[int], noise: int) -> str:
    """Return sentences about signs of two servos with one id.

    Args:
        twice: Ids that answered one request twice.
        noise: Number of received bytes outside of packets.
    """
    clues = "".join(
        f". Servo {servo} answered twice: another servo answers with its id"
        for servo in sorted(twice)
    )
    if noise:
        clues += f". {noise} bytes were damaged: two servos may have one id, or the line is noisy"
    return clues


class NoServos(BoardSilent):
    """The answers on the port are not from servos, or the baud rate is wrong."""

    code = "hw.no_servos"
    hint = "`armtree doctor --open` finds the baud rate"

    def __init__(self, port: str, seconds: float, noise: int) -> None:
        advice = (
            f"The {noise} received bytes are not packets: the baud rate is wrong, another "
            f"device is on this port, or two servos have one id. {_DOCTOR}"
        )
        super().__init__(port, seconds, "the position of any servo", advice)


class ServoMissing(BoardSilent):
    """A servo on the bus does not answer before the arm may move."""

    code = "hw.servo_missing"
    hint = "`armtree doctor --open` finds ids, baud rates and the likely cable"

    def __init__(
        self,
        port: str,
        seconds: float,
        missing: Sequence[str],
        answered: int,
        twice: Iterable[int] = (),
        noise: int = 0,
    ) -> None:
        one = len(missing) == 1
        what = f"the position of {'servo' if one else 'servos'} {', '.join(missing)}"
        advice = "Check their power, ids and baud rate, and the cable to the first of them"
        if one:
            advice = "Check its power, id and baud rate, and the cable to it"
        if answered:
            advice += f". {answered} {'servo' if answered == 1 else 'servos'} answered"
        super().__init__(port, seconds, what, f"{advice}{_clues(twice, noise)}. {_DOCTOR}")


class ServoTwice(BoardError):
    """Two servos on a bus have one id."""

    code = "hw.servo_twice"
    hint = "`armtree calibrate --ids` gives every servo its own id"

    def __init__(self, servos: Iterable[int]) -> None:
        named = ", ".join(map(str, sorted(servos)))
        super().__init__(
            f"The answers with the id {named} are damaged, as if two servos had that id. Connect "
            "the servos one by one with `armtree calibrate --ids`"
        )


class ServoSilent(BoardError):
    """Servos on a bus stopped answering."""

    code = "hw.servo_silent"
    hint = f"check cables, power and ids of the servos, then {ACTIVATE_AGAIN}"

    def __init__(
        self, servos: Sequence[str], total: int, cycles: int, twice: Iterable[int], noise: int
    ) -> None:
        one, clues = len(servos) == 1, _clues(twice, noise)
        what = f"{'Servo' if one else 'Servos'} {', '.join(servos)} did not answer"
        check = "Check the cable to it and its power"
        if not one:
            check = "Check the cable to the first of them and its power"
        if len(servos) == total:
            what = "No servo answered"
            check = "Check the power supply, the adapter and the cable to the first servo"
        way = _DOCTOR if clues else f"{check}, then run again"
        asked = plural(cycles, "request")
        super().__init__(f"{what} {asked} in a row{clues}. {way}{or_busy()}")


@dataclass(frozen=True, slots=True)
class ServoHealth:
    """Measured values of a servo, and the limits that the servo stores.

    Attributes:
        load: Load, as a share of the largest torque of the series.
        most_load: Limit of the load.
        celsius: Temperature [C].
        most_celsius: Limit of the temperature [C].
        volts: Supply voltage [V].
        least_volts: Lower limit of the voltage [V].
        most_volts: Upper limit of the voltage [V].
    """

    load: float
    most_load: float
    celsius: float
    most_celsius: float
    volts: float
    least_volts: float
    most_volts: float

    def __str__(self) -> str:
        return (
            f"at a load of {self.load:.0%} (limit {self.most_load:.0%}), {self.celsius:g} degrees "
            f"Celsius (limit {self.most_celsius:g}) and {self.volts:g} V (limits "
            f"{self.least_volts:g} and {self.most_volts:g})"
        )

    def reading(self, error: str) -> tuple[float, float]:
        """Return the value that causes an error, and its limit; both NaN if none is measured."""
        low = self.volts < self.least_volts
        return {
            "voltage": (self.volts, self.least_volts if low else self.most_volts),
            "temperature": (self.celsius, self.most_celsius),
            "overload": (self.load, self.most_load),
        }.get(error, (math.nan, math.nan))


class ServoFault(BoardError):
    """A servo on a bus reports an error, such as an overload.

    Attributes:
        joint: Name of the joint.
        value: Value that causes the first error with a measured cause; NaN if no error has one.
        limit: Limit of this value; NaN if no error has one.
    """

    code = "hw.servo_fault"
    hint = f"free the joint, let the servo cool down, then {ACTIVATE_AGAIN}"

    def __init__(self, servo: int, joint: str, errors: Sequence[str], health: ServoHealth) -> None:
        self.joint = joint
        readings = (health.reading(error) for error in errors)
        known = (each for each in readings if not math.isnan(each[0]))
        self.value, self.limit = next(known, (math.nan, math.nan))
        super().__init__(
            f"Servo {servo} of {joint} reports the error {' and '.join(errors) or 'unknown'}, "
            f"{health}. Free the joint, let the servo cool down, and check its supply, then run "
            "again. The servo may have let the joint go: gravity moves it"
        )


class TorqueLost(BoardError):
    """A servo on a bus lost its torque while the arm was active."""

    code = "hw.torque_lost"
    hint = f"support the arm and check the supply, then {ACTIVATE_AGAIN}"

    def __init__(self, servo: int, joint: str) -> None:
        super().__init__(
            f"Servo {servo} of {joint} no longer holds, although its torque was switched on: "
            "gravity moves the joint. A drop of its supply voltage restarts a servo; another "
            "program may also switch the torque off. Support the arm, check the supply and its "
            "cables, or limit acceleration_sum in the robot file, then run again"
        )


class CalibrationMissing(HardwareError):
    """The arm must be calibrated before it moves."""

    code = "hw.not_calibrated"
    exit_status = 3
    hint = "`armtree calibrate --robot ROBOT --port PORT`, as the message says"

    def __init__(self, path: Path, expected: Path, command: str) -> None:
        super().__init__(
            f"{path} needs a calibration, and {expected} does not exist. Write it with `{command}`;"
            " `--import FILE` imports a calibration by LeRobot. The port virtual needs none"
        )


class CalibrationDiffers(BoardError):
    """The stored values of a servo differ from the calibration file."""

    code = "hw.calibration_differs"
    hint = "`armtree calibrate`"

    def __init__(self, servo: int, joint: str, name: str, kept: int, expected: int) -> None:
        super().__init__(
            f"Servo {servo} of {joint} stores {name} = {kept}; the calibration file has {expected}."
            " The file belongs to another arm, or another program calibrated this arm. Connect the "
            "right arm, or run `armtree calibrate --robot ROBOT --port PORT`"
        )


class WrongMode(BoardError):
    """A servo is not in the mode for positions, but for example in the mode for wheels."""

    code = "hw.servo_mode"
    hint = "`armtree calibrate`"

    def __init__(self, servo: int, joint: str, mode: int) -> None:
        super().__init__(
            f"Servo {servo} of {joint} is in the mode {mode}, and not in the mode for positions "
            "(0): with torque it may turn without end. Another program has set this mode; "
            "`armtree calibrate --robot ROBOT --port PORT` sets mode 0"
        )


class SeamInside(BoardError):
    """The range of a joint contains the seam of its servo, where the position jumps to 0."""

    code = "hw.seam_inside"
    hint = "`armtree calibrate --centre`"

    def __init__(self, joints: Sequence[str], last: int, can_centre: bool) -> None:
        way = (
            "Run `armtree calibrate --centre`: it writes an offset to the servo, so that the seam "
            "is opposite to the middle of the range"
            if can_centre
            else "Take the horn off the servo, turn the servo by half a turn, and mount it again"
        )
        super().__init__(
            f"The range of {', '.join(joints)} contains the seam of its servo, where the position "
            f"jumps from {last} to 0, or the range is a whole turn. Nothing was written. {way}; do "
            "not turn a joint by more than a turn"
        )


class NotKept(BoardError):
    """A servo does not store a value that was written to it."""

    code = "hw.not_kept"
    hint = "check the cable, then `armtree calibrate --restore`"

    def __init__(self, servo: int, name: str, value: int, kept: int | None) -> None:
        reads = "does not answer" if kept is None else f"reads back {kept}"
        super().__init__(
            f"{name} = {value} was written to servo {servo}, which {reads}. Check the cable and "
            "the power, then run `armtree calibrate --restore`, which writes the earlier values"
        )


class NotReleased(BoardError):
    """The torque of a servo was switched off, and the servo does not confirm it."""

    code = "hw.not_released"
    hint = "check the cable and the power of the servo, then run the command again"

    def __init__(self, servos: Iterable[int]) -> None:
        named = ", ".join(map(str, servos))
        super().__init__(
            f"The torque was switched off, but these servos do not confirm it: {named}. Nothing "
            "was written. The other servos have no torque: hold the arm. Check the cables and the "
            "power, then run the command again"
        )
