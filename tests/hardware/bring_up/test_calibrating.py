"""Which values of the servos a calibration keeps for its restoration, in simulated time."""

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from hardware import BoardLink, DescriptionError, SimulatedClock, load_robot
from hardware.bring_up.calibrating import Calibrator, read_lerobot
from hardware.bring_up.search import answering
from hardware.description.calibration import write_calibration
from hardware.drivers.feetech.virtual.bus import Bus
from hardware.drivers.servo_errors import CalibrationDiffers
from tests.support.arms.bus_arms import bus_arm

SWEPT = {"homing": 7, "least": 1000, "most": 3100}


class Bench:
    """One robot file, and the arms that a person connects to it one after the other."""

    def __init__(self, folder: Path) -> None:
        self.robot = load_robot(bus_arm(folder), calibrated=False)

    def arm(self, **kept: int) -> Bus:
        """An arm whose servos keep these values, by register."""
        model = self.robot.model()
        assert isinstance(model, Bus)
        for servo in model.servos:
            for name, value in kept.items():
                servo.put(name, value)
        return model

    def calibrate(self, arm: Bus, servos: Mapping[int, object] | None = None) -> None:
        """Calibrates an arm. Only some servos are written if the command is interrupted."""
        kept: Mapping[str, Mapping[str, int]] = dict.fromkeys(self.robot.servos, SWEPT)
        clock = SimulatedClock()
        with (
            clock.working(),
            self.robot.servos_on(BoardLink(arm, clock), clock) as bus,
        ):
            calibrator = Calibrator(self.robot, bus, answering(self.robot, bus, "test"))
            kept = calibrator.in_position_mode(kept)
            changes = calibrator.changes(kept)
            joints = calibrator.joints(kept)
            write_calibration(calibrator.path, self.robot.name, "by a test", joints)
            calibrator.write(each for each in changes if servos is None or each.servo in servos)

    def restore(self, arm: Bus) -> None:
        clock = SimulatedClock()
        with (
            clock.working(),
            self.robot.servos_on(BoardLink(arm, clock), clock) as bus,
        ):
            calibrator = Calibrator(self.robot, bus, answering(self.robot, bus, "test"))
            calibrator.write(calibrator.changes(calibrator.before()))


def kept(arm: Bus) -> list[tuple[int, ...]]:
    names = "offset", "min_angle", "max_angle"
    return [tuple(servo.get(name) for name in names) for servo in arm.servos]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_the_values_before_the_first_calibration_survive_the_second(bench: Bench) -> None:
    arm = bench.arm(offset=5, min_angle=9)
    bench.calibrate(arm)
    bench.calibrate(arm)
    bench.restore(arm)
    assert kept(arm) == [(5, 9, 4095)] * 4


def test_a_second_arm_of_the_same_robot_gets_its_own_values_back(bench: Bench) -> None:
    one, two = bench.arm(offset=5, min_angle=9), bench.arm(offset=-88, min_angle=20)
    bench.calibrate(one)
    bench.calibrate(two)
    assert kept(two) == [(7, 1000, 3100)] * 4
    bench.restore(two)
    assert kept(two) == [(-88, 20, 4095)] * 4


def test_a_calibration_that_was_interrupted_keeps_the_first_values(bench: Bench) -> None:
    arm = bench.arm(offset=5, min_angle=9)
    bench.calibrate(arm, servos={1: ..., 2: ...})
    arm.servos[2].put("offset", 7)  # the first value of the third servo was written, too
    bench.calibrate(arm)
    bench.restore(arm)
    assert kept(arm) == [(5, 9, 4095)] * 4


def test_the_values_of_one_arm_are_not_written_to_another(bench: Bench) -> None:
    one, two = bench.arm(offset=5), bench.arm(offset=-88)
    bench.calibrate(one)
    why = "Servo 1 of joint_1 stores homing = -88; the calibration file has 7. The file belongs to"
    with pytest.raises(CalibrationDiffers, match=why):
        bench.restore(two)
    assert kept(two) == [(-88, 0, 4095)] * 4


def test_a_calibration_sets_the_mode_for_positions_and_gives_the_other_one_back(
    bench: Bench,
) -> None:
    arm = bench.arm(mode=1)
    bench.calibrate(arm)
    assert [servo.get("mode") for servo in arm.servos] == [0] * 4
    assert load_robot(bench.robot.path).kept["joint_1"] == {**SWEPT, "mode": 0}
    bench.restore(arm)
    assert [servo.get("mode") for servo in arm.servos] == [1] * 4


def test_a_file_by_lerobot_must_fit_the_servos(tmp_path: Path) -> None:
    robot, file = load_robot(bus_arm(tmp_path)), tmp_path / "lerobot.json"
    kept = {"drive_mode": 0, "homing_offset": 3000, "range_min": 1000, "range_max": 7000}
    file.write_text(json.dumps({f"joint_{k}": {"id": k, **kept} for k in range(1, 5)}))
    found = read_lerobot(file, robot.actuated, robot.servos, 8192)
    assert found["joint_1"] == {"homing": 3000, "least": 1000, "most": 7000}
    with pytest.raises(
        DescriptionError, match="joint_1 has homing_offset 3000, range_min 1000, range_max 7000"
    ):
        read_lerobot(file, robot.actuated, robot.servos, 4096)
