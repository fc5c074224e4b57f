"""What `armtree doctor --open` finds on a bus with servos, behind a real pseudo-terminal."""

import contextlib
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hardware import Check, load_robot
from hardware.bring_up.checks import check_bus
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from hardware.drivers.virtual.board_process import BoardProcess
from tests.support.arms.bus_arms import bus_arm
from tests.support.arms.hardware_rigs import Pty

pytestmark = pytest.mark.slow


@contextlib.contextmanager
def bus(folder: Path, change: Callable[[Bus], object], baud: int = 1_000_000) -> Iterator[str]:
    """The port of a bus that is not as the robot file says."""
    model = load_robot(bus_arm(folder)).model()
    assert isinstance(model, Bus)
    change(model)
    board = BoardProcess(model, baud)
    board.state()  # it has started
    yield board.port
    board.close()


def found(folder: Path, change: Callable[[Bus], object], baud: int = 1_000_000) -> dict[str, Check]:
    with bus(folder, change, baud) as port:
        return {check.name: check for check in check_bus(load_robot(folder / "arm.toml"), port)}


def vanish(*places: int) -> Callable[[Bus], object]:
    return lambda model: model.connect(0.0, [k for k in range(4) if k not in places])


def put(place: int, register: str, value: int) -> Callable[[Bus], object]:
    return lambda model: model.servos[place].put(register, value)


def test_all_servos_are_named_with_their_health(tmp_path: Path) -> None:
    checks = found(tmp_path, lambda model: None)
    assert checks["servos"].detail == "all 4 answer at 1000000 bit/s: ids 1 2 3 4"
    assert checks["supply"].detail.startswith("12 to 12 V, at most 25 degrees")
    assert checks["calibration"].detail.startswith("there is none")
    assert checks["measured"].detail.startswith("joint_1 0.0 deg")
    assert not any(check.ok is False for check in checks.values())


@pytest.mark.parametrize(
    ("change", "detail", "remedy"),
    [
        (
            vanish(2, 3),
            "2 of 4 answer at 1000000 bit/s; missing: 3 (joint_3), 4 (joint_4)",
            "check the cable between servo 2 (joint_2) and servo 3 (joint_3), or its power",
        ),
        (
            vanish(1, 2, 3),
            "1 of 4 answer at 1000000 bit/s; missing: 2 (joint_2), 3 (joint_3), 4 (joint_4)",
            "check the cable between servo 1 (joint_1) and servo 2 (joint_2), or its power",
        ),
        (
            put(1, "id", 9),
            "3 of 4 answer at 1000000 bit/s; missing: 2 (joint_2)",
            "check servo 2 of joint_2: servos after it answer, so no cable is broken: the servo is "
            "defective, its id is wrong, or another servo has the same id; servos answer with ids "
            "that no joint has: 9. Give them the right ids with armtree calibrate --ids",
        ),
        (
            put(1, "id", 3),  # with the position of servo 3, so that both look as one
            "3 of 4 answer at 1000000 bit/s; missing: 2 (joint_2)",
            "check servo 2 of joint_2: servos after it answer, so no cable is broken: the servo is "
            "defective, its id is wrong, or another servo has the same id",
        ),
        (
            lambda bus: [put(k, "id", 11 + k)(bus) for k in range(4)],
            "0 of 4 answer at 1000000 bit/s; missing: 1 (joint_1), 2 (joint_2), 3 (joint_3), "
            "4 (joint_4)",
            "servos answer with ids that no joint has: 11, 12, 13, 14. Give them the right ids "
            "with armtree calibrate --ids",
        ),
        (
            vanish(0, 1, 2, 3),
            "0 of 4 answer at 1000000 bit/s; missing: 1 (joint_1), 2 (joint_2), 3 (joint_3), "
            "4 (joint_4)",
            "check the power supply, the adapter or the cable to the first servo: no servo answers",
        ),
    ],
)
def test_a_missing_servo_is_named_with_the_likely_cable(
    tmp_path: Path, change: Callable[[Bus], object], detail: str, remedy: str
) -> None:
    check = found(tmp_path, change)["servos"]
    assert (check.ok, check.detail, check.remedy) == (False, detail, remedy)
    assert check.code == "hw.servo_missing"


def test_a_wrong_speed_is_found(tmp_path: Path) -> None:
    check = found(tmp_path, lambda model: None, baud=115_200)["baud"]
    assert check.detail == "servos 1 2 3 4 answer at 115200 bit/s; the robot file has 1000000"
    assert check.remedy.startswith("write baud = 115200 under [serial]")


def test_two_servos_with_one_id_are_found(tmp_path: Path) -> None:
    """Their answers to a ping are equal, and look as one. Their positions differ."""

    def same_id(model: Bus) -> None:
        model.servos[1].put("id", 3)
        model.servos[1].push(2500)

    check = found(tmp_path, same_id)["double ids"]
    assert "the answers with the id 3 are damaged, as if two servos had that id" in check.detail
    assert check.code == "hw.servo_twice"


def test_a_servo_that_answers_for_another_is_found(tmp_path: Path) -> None:
    checks = found(tmp_path, lambda bus: bus.fail(0.0, Fault("impersonate", 1, 0.0, 2)))
    assert checks["other ids"].detail == "the answer to a request for servo 1 has the id 2"


def test_noise_is_not_double_ids(tmp_path: Path) -> None:
    def damage(bus: Bus) -> None:
        for servo in bus.servos:
            bus.fail(0.0, Fault("damage", servo.servo, 0.0, 10_000))

    checks = found(tmp_path, damage)
    assert "double ids" not in checks
    assert "not another device; and check its cable" in checks["servos"].remedy


@pytest.mark.parametrize(
    ("change", "name", "words"),
    [
        (put(0, "position", 4000), "measured", "servo of joint_1 is at 171.6 deg"),
        (put(0, "min_voltage", 130), "error", "servo 1 reports voltage"),
        (put(1, "mode", 1), "mode", "Servo 2 of joint_2 is in the mode 1"),
    ],
)
def test_what_keeps_an_arm_from_moving_is_found(
    tmp_path: Path, change: Callable[[Bus], object], name: str, words: str
) -> None:
    def moved(model: Bus) -> None:
        change(model)
        if name == "measured":
            model.servos[0].push(4000)

    assert words in found(tmp_path, moved)[name].detail


def test_a_weak_supply_is_found(tmp_path: Path) -> None:
    def weak(model: Bus) -> None:
        for servo in model.servos:
            servo.supply = 4.2

    check = found(tmp_path, weak)["supply"]
    assert check.detail.startswith("4.2 to 4.2 V")
    assert check.code == "hw.voltage_low"


def test_another_device_on_the_port_is_no_bus(tmp_path: Path) -> None:
    line, robot = Pty(), load_robot(bus_arm(tmp_path))

    os.set_blocking(line.master, True)

    def chatter() -> None:
        with contextlib.suppress(OSError):  # the port is gone
            while os.read(line.master, 100):
                os.write(line.master, b"ok ")

    threading.Thread(target=chatter, daemon=True).start()
    checks = {check.name: check for check in check_bus(robot, line.port)}
    os.close(line.slave)
    assert checks["servos"].code == "hw.no_servos"
