"""Calibration: makes a calibration file and servo settings from ranges swept by hand."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hardware.description.calibration import CalibratedJoint, calibration_file, earlier_values
from hardware.description.robot import Robot
from hardware.drivers.servo_bus import POSITION_MODE, ServoBus, ServoReport
from hardware.drivers.servo_errors import CalibrationDiffers, SeamInside
from hardware.errors import DescriptionError
from hardware.files import read_file
from hardware.joints import Joint
from hardware.loading.dataclass import dataclass

from .sweep import Swept

_MAX_BYTES = 2**20  # largest calibration file [bytes]
LEAST_RANGE = 10.0  # smallest range of a swept joint [deg]


@dataclass(frozen=True, slots=True)
class Change:
    """A change of a value that a servo stores.

    Attributes:
        joint: Name of the joint.
        servo: Id of the servo.
        name: Name of the value, as in `ServoReport.kept`.
        old: The present value.
        new: The new value.
    """

    joint: str
    servo: int
    name: str
    old: int
    new: int


@dataclass(frozen=True, slots=True)
class Row:
    """The swept range of a joint.

    Attributes:
        joint: The joint.
        servo: Id of the joint's servo.
        now: Present position of the servo [ticks]; None before the first answer.
        least: Smallest position so far [ticks].
        most: Largest position so far [ticks].
        range: Angle between smallest and largest position [deg].
        seam: True if the servo passed its seam, or turned by a whole turn.
    """

    joint: Joint
    servo: int
    now: int | None = None
    least: int = 0
    most: int = 0
    range: float = 0.0
    seam: bool = False

    @property
    def swept(self) -> bool:
        """True if the range is large enough for a calibration."""
        return self.range >= LEAST_RANGE


class Calibrator:
    """Calibrates an arm. All servos must answer, and none may have torque.

    Args:
        robot: The robot, without a calibration.
        bus: The open bus.
        reports: Report of each servo, by its id.

    Raises:
        DescriptionError: The present calibration file is wrong.
    """

    def __init__(self, robot: Robot, bus: ServoBus, reports: Mapping[int, ServoReport]) -> None:
        self._robot, self._bus, self._servos = robot, bus, robot.servos
        self._reports = {joint: reports[servo] for joint, servo in robot.servos.items()}
        self._swept, self._degrees = dict[int, Swept](), bus.turn / bus.ticks
        self.path = calibration_file(robot.path)
        self._earlier = earlier_values(self.path, robot.name, bus.ticks)

    def read(self) -> None:
        """Read the positions of the servos once."""
        for servo, position in self._bus.positions([*self._servos.values()]).items():
            start = Swept(self._bus.ticks, position, position, position)
            self._swept.setdefault(servo, start).move(position)

    @property
    def rows(self) -> list[Row]:
        """The swept range of each joint."""
        return [self._row(joint) for joint in self._robot.actuated]

    def _row(self, joint: Joint) -> Row:
        servo = self._servos[joint.name]
        if (swept := self._swept.get(servo)) is None:
            return Row(joint, servo)
        now, turned = swept.now % self._bus.ticks, swept.range * self._degrees
        seam = swept.seam_inside or swept.whole_turn
        return Row(joint, servo, now, swept.least, swept.most, turned, seam)

    def kept(self, centre: bool) -> dict[str, dict[str, int]]:
        """Return the values to store in each joint's servo for the swept ranges.

        Args:
            centre: True to move the seam of every servo, where its position jumps to 0, opposite to
                the middle of its range.

        Raises:
            SeamInside: A range contains the seam, or a whole turn.
        """
        can_centre = all("homing" in report.kept for report in self._reports.values())
        whole = [s for s in self._swept.values() if s.whole_turn]
        wrong = [row.joint.name for row in self.rows if row.seam]
        if whole or (wrong and not (centre and can_centre)):
            raise SeamInside(wrong, self._bus.ticks - 1, can_centre)
        found = dict[str, dict[str, int]]()
        for joint, report in self._reports.items():
            swept = self._swept[self._servos[joint]]
            found[joint] = swept.kept(report.kept.get("homing"), centre and can_centre)
        return found

    def in_position_mode(self, kept: Mapping[str, Mapping[str, int]]) -> dict[str, dict[str, int]]:
        """Return the values to store, and the mode for positions for each servo with modes."""
        reports = self._reports.items()
        modes = {joint: {"mode": POSITION_MODE} for joint, each in reports if "mode" in each.kept}
        return {joint: {**values, **modes.get(joint, {})} for joint, values in kept.items()}

    def changes(self, kept: Mapping[str, Mapping[str, int]]) -> list[Change]:
        """Return the changes of stored values that make them equal to `kept`."""
        return [
            Change(joint, self._servos[joint], name, self._reports[joint].kept[name], value)
            for joint, values in kept.items()
            for name, value in values.items()
            if self._reports[joint].kept[name] != value
        ]

    def joints(self, kept: Mapping[str, Mapping[str, int]]) -> dict[str, CalibratedJoint]:
        """Return the calibration of each joint, with the first values of its servo."""
        found = dict[str, CalibratedJoint]()
        for joint in self._robot.actuated:
            report, values = self._reports[joint.name], kept[joint.name]
            before = {name: report.kept[name] for name in values}
            if joint.name in self._earlier and not self._difference(joint.name):
                before |= self._first(joint.name)
            calibrated = self._robot.calibrated(
                joint, {"id": report.servo, **values}, self._degrees
            )
            found[joint.name] = replace(calibrated, before=before)
        return found

    def before(self) -> dict[str, dict[str, int]]:
        """Return the values of each joint's servo before the first calibration.

        Raises:
            DescriptionError: There is no calibration file.
            CalibrationDiffers: The calibration file belongs to other servos.
        """
        if not self._earlier:
            raise DescriptionError(self.path, 0, "does not exist; there is nothing to restore")
        if error := self.difference:
            raise error
        return {joint: self._first(joint) for joint in self._earlier}

    def _first(self, joint: str) -> dict[str, int]:
        return {name: first for name, (first, _) in self._earlier[joint].items()}

    @property
    def difference(self) -> CalibrationDiffers | None:
        """An error if the calibration file belongs to other servos, or None."""
        return next(filter(None, map(self._difference, self._reports)), None)

    def _difference(self, joint: str) -> CalibrationDiffers | None:
        """Return an error if a joint's servo has values that the calibration file lacks, or None.

        Each value may be the first or the last one, as after an interrupted calibration.
        """
        report = self._reports[joint]
        for name, (first, last) in self._earlier.get(joint, {}).items():
            if (now := report.kept.get(name)) not in (first, last):
                return CalibrationDiffers(report.servo, joint, name, now or 0, last)
        return None

    def write(self, changes: Iterable[Change]) -> None:
        """Write values to the servos, and check them.

        Raises:
            NotKept: A servo reads back another value, or does not answer.
        """
        by_servo = dict[int, dict[str, int]]()
        for change in changes:
            by_servo.setdefault(change.servo, {})[change.name] = change.new
        for servo, values in by_servo.items():
            self._bus.keep(servo, values)


def read_lerobot(
    path: Path, joints: Sequence[Joint], servos: Mapping[str, int], ticks: int
) -> dict[str, dict[str, int]]:
    """Return the stored values of each joint's servo, from a calibration file of LeRobot.

    LeRobot has written these values to the servos. `drive_mode` must be 0, as in every SO-101.

    Args:
        path: The file.
        joints: The joints of the arm.
        servos: Id of the servo of each joint, by its name.
        ticks: Number of positions in a turn of a servo.

    Raises:
        DescriptionError: The file is wrong, or has other joints.
    """
    try:
        values: Any = json.loads(read_file(path, _MAX_BYTES))
        return {
            joint.name: _lerobot_joint(joint.name, values[joint.name], servos[joint.name], ticks)
            for joint in joints
        }
    except OSError as error:
        raise DescriptionError(path, 0, f"cannot be read: {error.strerror}") from error
    except KeyError as error:
        why = f"has no {error}; it must have the names of the joints in the URDF"
        raise DescriptionError(path, 0, why) from error
    except (ValueError, TypeError, RecursionError) as error:
        why = f"is not a calibration by LeRobot for this arm: {error}; calibrate without --import"
        raise DescriptionError(path, 0, why) from error


def _lerobot_joint(joint: str, values: Mapping[str, int], servo: int, ticks: int) -> dict[str, int]:
    names = {"homing": "homing_offset", "least": "range_min", "most": "range_max"}
    if values["drive_mode"] != 0:
        raise ValueError(f"{joint} has drive_mode {values['drive_mode']!r}; it must be 0")
    if values["id"] != servo:
        raise ValueError(f"{joint} has id {values['id']!r}; the robot file has {servo}")
    found = {name: values[key] for name, key in names.items()}
    given = ", ".join(f"{key} {values[key]!r}" for key in names.values())
    if not all(type(value) is int for value in found.values()):
        raise ValueError(f"{joint} has {given}; they must be whole numbers")
    inside = 0 <= found["least"] < found["most"] < ticks
    if not (inside and abs(found["homing"]) < ticks // 2):
        limits = f"0 <= range_min < range_max < {ticks}, homing_offset within +-{ticks // 2 - 1}"
        raise ValueError(f"{joint} has {given}; needed: {limits}")
    return found


def degrees(joint: Joint) -> float:
    """Return the range of a joint in the URDF [deg]."""
    return math.degrees(joint.upper - joint.lower)
