"""Robot files: the shipped one, one of another arm, and many that are wrong."""
# ruff: noqa: E501 (tables of one mistake a line)

import math
import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from hardware import DescriptionError, Mimic, Robot, load_robot
from hardware.drivers.arduino.frames import Codec

SHIPPED = load_robot()
TOML, URDF = SHIPPED.path.read_text(), SHIPPED.urdf.read_text()
WIRE_1 = 'wire = { letter = "b", sign = 1, offset_deg = 90, span_deg = 180, reversed = false }'


def written(folder: Path, toml: str = TOML, urdf: str = URDF) -> Path:
    (folder / "arduinobot.urdf").write_text(urdf)
    path = folder / "robot.toml"
    path.write_text(toml)
    return path


def replaced(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def refusal(path: Path) -> str:
    with pytest.raises(DescriptionError) as refused:
        load_robot(path)
    return str(refused.value)


def test_the_shipped_robot() -> None:
    robot = SHIPPED
    assert robot.name == "arduinobot"
    assert [joint.name for joint in robot.joints] == [f"joint_{k}" for k in range(1, 6)]
    assert robot.groups == {
        "arm": ("joint_1", "joint_2", "joint_3"),
        "gripper": ("joint_4", "joint_5"),
    }
    assert robot.boot_pose == (0.0, 0.0, 0.0, 0.0)
    assert {(j.velocity, j.acceleration) for j in robot.joints} == {(1.0, 0.5)}
    assert robot.joint("joint_5").mimic == Mimic("joint_4", -1.0, 0.0)
    assert [joint.name for joint in robot.actuated_in("gripper")] == ["joint_4"]
    assert (robot.serial.port, robot.serial.baud, robot.serial.boot_wait) == ("virtual", 115200, 2)
    assert robot.firmware.name == "stock"
    assert len(robot.collision.allowed) == 13


def test_its_limits_are_the_literals_of_its_urdf() -> None:
    quarter = 1.570796326795
    limits = [(joint.lower, joint.upper) for joint in SHIPPED.joints]
    assert limits == [(-quarter, quarter)] * 3 + [(-quarter, 0.0), (0.0, quarter)]


def test_an_unknown_joint_gets_a_list_of_the_known_ones() -> None:
    with pytest.raises(KeyError, match="no joint joint_9; there are joint_1, joint_2"):
        SHIPPED.joint("joint_9")


# error: original text, wrong text, text in the line that the message names, message
WRONG = {
    "unknown key": ('name = "arduinobot"', 'nmae = "a"\nname = "b"', "nmae", "nmae: unknown key; .*did you mean name"),
    "no name": ('name = "arduinobot"', "", None, "name: is missing"),
    "name is a number": ('name = "arduinobot"', "name = 1", "name =", "name: 1 is not a text"),
    "no such urdf": ('"arduinobot.urdf"', '"none.urdf"', "urdf =", "urdf: .*none.urdf cannot be read: No such file"),
    "urdf is a folder": ('"arduinobot.urdf"', '"."', "urdf =", "urdf: .* cannot be read: Is a directory"),
    "urdf is a URI": ('"arduinobot.urdf"', '"package://arm/urdf/arm.urdf"', "urdf =", r"'package://arm/urdf/arm.urdf' is a URI; give the path of the file(.*\n){4}    urdf = \"arm.urdf\""),
    "urdf has no file name": ('"arduinobot.urdf"', '"a\\u0000b"', "urdf =", "urdf: .* cannot be read"),
    "no serial": ("[serial]", "[seriel]", "[seriel]", "seriel: unknown key; did you mean serial"),
    "port is a number": ('port = "virtual"', "port = 3", "port =", "serial.port: 3 is not a text"),
    "baud is a text": ("baud = 115200", 'baud = "fast"', "baud =", "serial.baud: 'fast' is not a whole number"),
    "baud is zero": ("baud = 115200", "baud = 0", "baud =", "serial.baud: 0 is not from 1200 to 4000000"),
    "baud is one": ("baud = 115200", "baud = 1", "baud =", "serial.baud: 1 is not from 1200 to 4000000"),
    "baud is huge": ("baud = 115200", f"baud = {10**400}", "baud =", r"serial.baud: 10+\.\.\.0+ is not from 1200"),
    "boot wait is a day": ("boot_wait_s = 2.0", "boot_wait_s = 86400", "boot_wait_s", "serial.boot_wait_s: 86400 is not allowed; .* at most 60"),
    "guards of a board that measures nothing": ('[groups]', '[guards]\nmost_c = 60\n[groups]', "guards", "guards: the table is not allowed, because a board with stock measures nothing"),
    "brake of a day": ('name = "arduinobot"', 'name = "arduinobot"\nbrake_s = 86400', "brake_s", "brake_s: 86400 is not allowed; .* at most 10"),
    "brackets": ('name = "arduinobot"', f'name = {"[" * 100_000}', None, "its lists or tables are nested too deep"),
    "too long": ('name = "arduinobot"', "#" * 2**18, None, "cannot be read: it is larger than 262144 bytes"),
    "urdf is a device": ('"arduinobot.urdf"', '"/dev/zero"', "urdf =", "urdf: /dev/zero cannot be read: it is not an ordinary file"),
    "baud is half": ("baud = 115200", "baud = 1.5", "baud =", "serial.baud: 1.5 is not a whole number"),
    "boot wait is too short": ("boot_wait_s = 2.0", "boot_wait_s = 0.5", "boot_wait_s", "serial.boot_wait_s: 0.5 s is too short: stock needs 1 s"),
    "velocity over the URDF's": ("velocity = 1.0", "velocity = 11.0", "velocity =", "joints.joint_1.velocity: 11 rad/s is more than the URDF's limit, 10 rad/s"),
    "a misspelt key": ("velocity = 1.0", "velocty = 1.0", "velocty", "joints.joint_1.velocty: unknown key; did you mean velocity"),
    "a misspelt group": ("gripper = [", "griper = [", "griper", "groups.griper: unknown key; .* did you mean gripper"),
    "no baud": ("baud = 115200", "", "[serial]", "serial.baud: is missing"),
    "boot wait is negative": ("boot_wait_s = 2.0", "boot_wait_s = -1", "boot_wait_s", "serial.boot_wait_s: -1 is not allowed; it must be at least 0"),
    "boot wait is endless": ("boot_wait_s = 2.0", "boot_wait_s = inf", "boot_wait_s", "serial.boot_wait_s: inf is not allowed; it must be .*finite"),
    "unknown firmware": ('firmware = "stock"', 'firmware = "stok"', "firmware =", "serial.firmware: 'stok' is not one of stock, armtree; did you mean stock"),
    "unknown key in serial": ("baud = 115200", "baud = 115200\nparity = 1", "parity", "serial.parity: unknown key; there are baud"),
    "joint in no group": ('"joint_1", "joint_2"', '"joint_2"', "[groups]", "groups: joint joint_1 is in 0 groups; write it in one"),
    "joint in two groups": ('["joint_4", "joint_5"]', '["joint_4", "joint_5", "joint_1"]', "[groups]", "joint joint_1 is in 2 groups"),
    "unknown joint in a group": ('"joint_5"]', '"joint_6"]', "gripper =", "groups.gripper: 'joint_6' is not one of joint_1, .*joint_5"),
    "joint twice in a group": ('"joint_1", "joint_2"', '"joint_1", "joint_1", "joint_2"', "arm =", "groups.arm: .* contains a name twice"),
    "group is not a list": ('arm = ["joint_1", "joint_2", "joint_3"]', 'arm = "joint_1"', "arm =", "groups.arm: 'joint_1' is not a list"),
    "group of lists": ('"joint_5"]', '["joint_5"]]', "gripper =", r"groups.gripper: \['joint_5'\] is not one of"),
    "joint not in the urdf": ("[joints.joint_1]", "[joints.joint_0]", "[joints.joint_0]", "joints.joint_0: the URDF has no such joint; it has joint_1"),
    "mimic with a servo": ("[joints.joint_4]", "[joints.joint_5]", "[joints.joint_5]", "joints.joint_5: follows another joint"),
    "no joints": (TOML[TOML.index("[joints.joint_1]") : TOML.index("[collision]")], "[joints]\n", "[joints]", "joints: "),
    "joint is not a table": ("[joints.joint_1]", "[joints]\njoint_1 = 3\n[groups.nothing]", "joint_1 = 3", "joints.joint_1: 3 is not a table"),
    "velocity is zero": ("velocity = 1.0", "velocity = 0", "velocity = 0", "joints.joint_1.velocity: 0 is not allowed; it must be greater than 0"),
    "group is one text": ('arm = ["joint_1", "joint_2", "joint_3"]', 'arm = "joint_1, joint_2, joint_3"', "arm =", r'is not a list; write \["joint_1", "joint_2", "joint_3"\]'),
    "velocity has a unit": ("velocity = 1.0", 'velocity = "60 deg/s"', "velocity =", r"joints.joint_1.velocity: '60 deg/s' is not a number; write 1.0472\n(.*\n){2}  write:\n    velocity = 1.0472"),
    "a text without quotes": ('port = "virtual"', "port = ttyUSB0", "port =", r'a text needs quotes\n(.*\n){2}  write:\n    port = "ttyUSB0"'),
    "a colon for a sign": ("baud = 115200", "baud: 115200", "baud", r"`=` separates a key from its value, not a colon\n(.*\n){2}  write:\n    baud = 115200"),
    "a word of Python": ("reversed = false", "reversed = False", "reversed = False", r"write:\n    wire = { letter = .*, reversed = false }"),
    "velocity is not a number": ("velocity = 1.0", "velocity = nan", "velocity = nan", "joints.joint_1.velocity: nan is not allowed"),
    "velocity is beyond floats": ("velocity = 1.0", f"velocity = {10**400}", "velocity = 1000", "joints.joint_1.velocity: inf is not allowed"),
    "velocity is true": ("velocity = 1.0", "velocity = true", "velocity = true", "joints.joint_1.velocity: True is not a number"),
    "no acceleration": ("acceleration = 0.5", "", "[joints.joint_1]", "joints.joint_1.acceleration: is missing"),
    "boots outside": ("boot = 0.0", "boot = 2.0", "boot = 2.0", r"joints.joint_1.boot: 2 is outside \[-1.5708, 1.5708\]"),
    "boots nowhere": ("boot = 0.0", "boot = nan", "boot = nan", "joints.joint_1.boot: nan is not allowed; it must be finite"),
    "no wire": (WIRE_1, "", "[joints.joint_1]", "joints.joint_1.wire: is missing"),
    "letter is two": ('letter = "b"', 'letter = "bb"', "wire =", "joints.joint_1.wire.letter: 'bb' is not one letter from a to z"),
    "letter is a digit": ('letter = "b"', 'letter = "1"', "wire =", "joints.joint_1.wire.letter: '1' is not one letter"),
    "letter of another": ('letter = "b"', 'letter = "s"', "[joints.joint_2]", "joints.joint_2: its letter s is already the letter of joint_1"),
    "sign is two": ("sign = 1,", "sign = 2,", "wire =", "joints.joint_1.wire.sign: 2 is not one of -1, 1"),
    "span is zero": ("span_deg = 180", "span_deg = 0", "wire =", "joints.joint_1.wire.span_deg: 0 is not allowed"),
    "span is next to nothing": ("span_deg = 180", "span_deg = 1e-323", "wire =", "joints.joint_1.wire: .* is not a servo angle"),
    "span is tiny": ("span_deg = 180", "span_deg = 1e-306", "wire =", "joints.joint_1.wire: .* is not a servo angle"),
    "span leaves the servo": ("span_deg = 180", "span_deg = 90", "wire =", "joints.joint_1.wire: .* is not a servo angle from 0 to 180"),
    "reversed is a number": ("reversed = false", "reversed = 0", "wire =", "joints.joint_1.wire.reversed: 0 is not true or false"),
    "unknown key on the wire": ("reversed = false", "reversed = false, min = 1", "wire =", "joints.joint_1.wire.min: unknown key"),
    "margin is negative": ("margin_m = 0.005", "margin_m = -0.1", "margin_m", "collision.margin_m: -0.1 is not allowed"),
    "brake is negative": ('name = "arduinobot"', 'name = "arduinobot"\nbrake_s = -1', "brake_s", "brake_s: -1 is not allowed; it must be at least 0"),
    "floor is a text": ("floor_m = 0.0", 'floor_m = "low"', "floor_m", "collision.floor_m: 'low' is not a number"),
    "unknown link": ('floor_ignores = ["base_link"]', 'floor_ignores = ["base"]', "floor_ignores", "collision.floor_ignores: 'base' is not one of .*did you mean base_"),
    "pair of three": ('["base_link", "base_plate"]', '["base_link", "base_plate", "claw_support"]', "allowed", "collision.allowed: .* is not a pair of names"),
    "pair with itself": ('["base_link", "base_plate"]', '["base_link", "base_link"]', "allowed", "collision.allowed: .* contains a name twice"),
    "pair of numbers": ('["base_link", "base_plate"]', "[1, 2]", "[1, 2]", "collision.allowed: 1 is not one of"),
    "tool on no link": ('link = "claw_support"', 'link = "claw_suport"', "link =", "tool.link: 'claw_suport' is not one of .*did you mean claw_support"),
    "tool in a plane": ("[-0.013, 0.06, -0.0155]", "[0.0, 0.1]", "offset_m", r"tool.offset_m: .* is not three finite numbers"),
    "tool nowhere": ("[-0.013, 0.06, -0.0155]", "[0.0, nan, true]", "offset_m", "tool.offset_m: .* is not three finite numbers"),
    "pad on no link": ("gripper_left = [", "gripper_lef = [", "pads =", "gripper.pads.gripper_lef: the URDF has no such link; .*did you mean gripper_left"),
    "one pad": (", gripper_left = [0.0087, 0.0439, -0.0055]", "", "pads =", "gripper.pads: must have two points: one on each"),
    "pads on the axes": ("[-0.0085, 0.0439, -0.0055], gripper_left = [0.0087, 0.0439, -0.0055]", "[0, 0, 0], gripper_left = [0, 0, 0]", "pads =", "gripper.pads: two positions of the joint have the same distance"),
    "pads of the arm": ('"joint_3"]\ngripper = [', ']\ngripper = ["joint_3", ', "[gripper]", "gripper: the group gripper has 2 independent joints"),
    "thousands of digits": ("margin_m = 0.005", f"margin_m = 1{5000 * '0'}", "", "Exceeds the limit"),
    "tool beyond numbers": ("[-0.013, 0.06, -0.0155]", f"[0, 0, {10**400}]", "offset_m", r"tool.offset_m: .* is not three finite numbers"),
    "tool points beyond numbers": ("axis = [0.0, 1.0, 0.0]", f"axis = [0, {10**400}, 0]", "axis =", "tool.axis: .* is not three finite numbers"),
    "tool points as in a URDF": ("axis = [0.0, 1.0, 0.0]", 'axis = "0 1 0"', "axis =", r"tool.axis: '0 1 0' is not three finite numbers; write \[0, 1, 0\]"),
    "an abbreviated key": ("acceleration = 0.5", "acc = 0.5", "acc = 0.5", "joints.joint_1.acc: unknown key; did you mean acceleration"),
    "tool points nowhere": ("axis = [0.0, 1.0, 0.0]", "axis = [0, 0, 0]", "axis =", "tool.axis: is zero"),
    "no toml": ("[serial]", "[serial", "[serial", r"the \[ is not closed\n(.*\n){2}  write:\n    \[serial\]"),
    "key twice": ("baud = 115200", "baud = 1\nbaud = 2", "baud = 2", "this key is given twice; leave one of them out"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "found", "why"), WRONG.values(), ids=WRONG)
def test_a_wrong_robot_file(tmp_path: Path, old: str, new: str, found: str, why: str) -> None:
    path = written(tmp_path, replaced(TOML, old, new))
    lines = path.read_text().splitlines()
    line = next((n for n, text in enumerate(lines, 1) if found and found in text), None)
    place = f"{path}:{line}: " if line else f"{path}: "
    said = refusal(path)
    assert re.search(rf"^{re.escape(place)}", said, re.MULTILINE)
    assert re.search(why, said), said


def test_all_mistakes_of_joints_and_tables_are_reported_at_once(tmp_path: Path) -> None:
    slips = {
        "[groups]": "[group]",
        "velocity = 1.0": 'velocity = "fast"',
        "boot = 0.0": "boot = 90",
        "acceleration = 0.5": "acceleraton = 0.5",
        'letter = "s"': 'letter = "ss"',
        "baud = 115200": "baud = 1",
        "margin_m = 0.005": "margin_m = -1",
        'home = "upright open"': "brakes = 1",
    }
    toml = TOML
    for old, new in slips.items():
        toml = replaced(toml, old, new)
    path = written(tmp_path, toml)
    numbered = list(enumerate(toml.splitlines(), 1))
    line = {new: next(n for n, text in numbered if new in text) for new in slips.values()}
    first, *mistakes = refusal(path).split(f"\n{path}:")
    assert first == f"{path}: 8 mistakes"
    assert [int(each.partition(":")[0]) for each in mistakes] == sorted(line.values())
    for new, why in {
        "boot = 90": r"boot: 90 is outside \[.*\]; 90 degrees are 1.5707963267948966 rad$",
        'velocity = "fast"': "velocity: 'fast' is not a number; write a number without quotes and unit$",
        "acceleraton = 0.5": "acceleraton: unknown key; did you mean acceleration",
        'letter = "ss"': "joint_2.wire.letter: 'ss' is not one letter",
        "[group]": r"group: unknown key; did you mean groups\?$",
        "baud = 1": "serial.baud: 1 is not from 1200",
        "margin_m = -1": "collision.margin_m: -1 is not allowed",
        "brakes = 1": "brakes: unknown key; did you mean brake_s",
    }.items():
        (said,) = (each for each in mistakes if each.startswith(f"{line[new]}: "))
        assert re.search(why, said, re.MULTILINE)
        assert f"\n    {toml.splitlines()[line[new] - 1][:9]}" in said


def test_all_slips_of_the_layout_are_reported_at_once_with_the_wrong_values(tmp_path: Path) -> None:
    slips = {
        "baud = 115200": "baud: 115200",
        'port = "virtual" ': "port = /dev/ttyUSB0",
        "[groups]": "[groups",
        "velocity = 1.0": "velocity = 60 deg",
        'letter = "s", sign = 1': "letter: s, sign: 1",
        "reversed = false": "reversed = False",
        "margin_m = 0.005": "margin_m = 0,005",
        '["base_link", "base_plate"]': '["base_link" "baseplate"]',
        "[0.0, 1.0, 0.0]": "[0, 1, 0",
        'home = "upright open"': "home upright open",
        "[joints.joint_3]": "[joints.joint3]",
    }
    toml = TOML
    for old, new in slips.items():
        toml = replaced(toml, old, new)
    said = refusal(written(tmp_path, toml))
    assert said.startswith(f"{tmp_path}/robot.toml: 11 mistakes\n")
    for right in (
        "baud = 115200",
        'port = "/dev/ttyUSB0"',
        "[groups]",
        "velocity = 1.0472",
        'wire = { letter = "s", sign = 1,',
        "reversed = false",
        "margin_m = 0.005",
        '["base_link", "base_plate"]',
        "axis = [0, 1, 0]",
        'home = "upright open"',
        "[joints.joint_3]",
    ):
        assert re.search(rf"  write:\n    .*{re.escape(right)}", said), right


LIMIT = re.findall("<limit.*?/>", URDF)[0]
ORIGIN = '<origin xyz="0 0 0.0307" rpy="0 0 0"'

WRONG_URDF = {
    "no xml": ("<robot", "robot", r"arduinobot.urdf:\d+: is not XML"),
    "no urdf": (URDF, "<html/>", "arduinobot.urdf: is not a URDF: its root element is <html>, not <robot>"),
    "no name": (' name="arduinobot"', "", 'arduinobot.urdf:14: the robot has no name; write <robot name="my_arm">'),
    "no links": (URDF, '<robot name="r"/>', "arduinobot.urdf: has no links; give it at least one"),
    "no lower": ('lower="-1.570796326795"', "", r"joint joint_1: the lower of its limit is missing; give a finite number \[rad\]"),
    "no effort": ('effort="30.0"', "", "joint joint_1: the effort of its limit is missing; give a finite number of at least 0"),
    "no limit": (LIMIT, "", "joint joint_1: it has no limit; give one with its lower, upper, velocity and effort"),
    "limit is a text": ('lower="-1.570796326795"', 'lower="low"', "joint joint_1: the lower of its limit is 'low'; give a finite"),
    "limit with a unit": ('lower="-1.570796326795"', 'lower="-1_0"', "joint joint_1: the lower of its limit is '-1_0'"),
    "limits crossed": ('lower="-1.570796326795"', 'lower="2"', 'joint joint_1: lower 2 is above upper 1.5708; write lower="1.5708" upper="2"'),
    "limit is misspelt": ('lower="-1.570796326795"', 'lowwer="-1.570796326795"', "joint joint_1: the lower of its limit is missing; write lower for lowwer"),
    "limit has other names": ('lower="-1.570796326795" upper', 'min="-1.570796326795" upper', r"joint joint_1: the lower of its limit is missing; give a finite number \[rad\]; min is not known in <limit>"),
    "position of a joint is misspelt": (ORIGIN, ORIGIN.replace("xyz", "xzy"), "joint joint_1: the xyz of its origin is missing; write xyz for xzy"),
    "parent has a name": ('<parent link="base_link"/>', '<parent name="base_link"/>', "joint joint_1 has no parent; write <parent link=\"base_link\"/> in it"),
    "limit is not a number": ('lower="-1.570796326795"', 'lower="nan"', "joint joint_1: the lower of its limit is 'nan'; give a finite number"),
    "limit is endless": ('upper="1.570796326795"', 'upper="1e400"', "joint joint_1: the upper of its limit is '1e400'"),
    "velocity is negative": ('velocity="10.0"', 'velocity="-1"', r"joint joint_1: the velocity of its limit is '-1'; .* at least 0 \[rad/s\]"),
    "origin of two numbers": (ORIGIN, '<origin xyz="0 0"', "joint joint_1: the xyz of its origin is '0 0'; give three finite numbers"),
    "origin is not a number": (ORIGIN, '<origin xyz="0 0 nan"', "joint joint_1: the xyz of its origin is '0 0 nan'"),
    "origin of texts": (ORIGIN, '<origin rpy="a"', r"joint joint_1: the rpy of its origin is 'a'; .* \[rad\]"),
    "two joints of a name": ('<joint name="joint_2"', '<joint name="joint_1"', "two joints are called joint_1; give each a name of its own"),
    "two links of a name": ('<link name="base_link"', '<link name="world"', "two links are called world; give each a name of its own"),
    "joint without a name": ('<joint name="joint_2"', "<joint", r"joint \d of \d+ has no name; give it one"),
    "link without a name": ("</robot>", "<link/></robot>", r"link (\d+) of \1 has no name; give it one"),
    "two roots": ("</robot>", '<link name="lost"/></robot>', "links world and lost have no parent joint; only one link may have none; give each other link a joint, such as <joint name=\"to_lost\" type=\"fixed\"><parent link=\"world\"/><child link=\"lost\"/></joint>"),
    "mimic of an unknown joint": ('<mimic joint="joint_4"', '<mimic joint="joint_8"', "joint_5 follows joint_8, which has no table; let it follow one of these: joint_1, joint_2"),
    "mimic of itself": ('<mimic joint="joint_4"', '<mimic joint="joint_5"', "joint joint_5: it mimics itself; let it mimic another joint, or none"),
    "mimic by no number": ('multiplier="-1"', 'multiplier="nan"', "joint joint_5: the multiplier of its mimic is 'nan'; give a finite number"),
    "no leader": ('<mimic joint="joint_4"', "<mimic", "joint joint_5: the joint of its mimic is missing; give the name of the joint to follow"),
    "planar joint": ('type="revolute"', 'type="planar"', "joint joint_1 is planar; it must be revolute, continuous, prismatic or fixed"),
    "floating joint": ('type="fixed"', 'type="floating"', r"joint \w+ is floating; it must be"),
    "axis without a length": ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "joint joint_1: its axis is '0 0 0'; give x, y, z of a vector with a length, such as 0 0 1"),
    "axis hardly longer": ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1e-320"/>', "joint joint_1: its axis is '0 0 1e-320'"),
    "axis of two numbers": ('<axis xyz="0 0 1"/>', '<axis xyz="0 0"/>', "joint joint_1: its axis is '0 0'"),
    "axis is not a number": ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 nan"/>', "joint joint_1: its axis is '0 0 nan'"),
    "axis of texts": ('<axis xyz="0 0 1"/>', '<axis xyz="up"/>', "joint joint_1: its axis is 'up'"),
    "child above itself": ('<child link="horizontal_arm"/>', '<child link="base_plate"/>', "joint joint_3: its child base_plate is already the child of joint_1"),
    "parent below itself": ('<parent link="base_link"/>', '<parent link="horizontal_arm"/>', "joint joint_1 is its own ancestor, through joint_3, joint_2; give it another child link"),
    "child is its parent": ('<parent link="base_link"/>', '<parent link="base_plate"/>', "joint joint_1 has the same link as parent and child, base_plate; give"),
    "no such parent": ('<parent link="base_link"/>', '<parent link="base"/>', "joint joint_1: its parent base is not a link; there are .*; did you mean base_link"),
    "no child": ('<child link="base_plate"/>', "", 'joint joint_1 has no child; write <child link="NAME"/>'),
    "no such encoding": ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="foo"?>', "cannot be read: unknown encoding: foo"),
    "too long": ("</robot>", " " * 2**20 + "</robot>", "cannot be read: it is larger than 1048576 bytes"),
    "joint without a description": ('name="joint_1"', 'name="joint_x"', "the URDF has no such joint"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "why"), WRONG_URDF.values(), ids=WRONG_URDF)
def test_a_wrong_urdf(tmp_path: Path, old: str, new: str, why: str) -> None:
    said = refusal(written(tmp_path, urdf=replaced(URDF, old, new)))
    assert said.startswith(str(tmp_path))
    assert re.search(why, said), said


def test_a_follower_over_its_own_velocity(tmp_path: Path) -> None:
    fast = replaced(URDF, 'multiplier="-1"', 'multiplier="-10.5"')
    said = refusal(written(tmp_path, urdf=fast))
    assert (
        "joints.joint_4.velocity: 1 rad/s moves joint_5 at 10.5 rad/s, "
        "more than the URDF's limit, 10 rad/s\n"
    ) in said
    just = replaced(URDF, 'multiplier="-1"', 'multiplier="-10"')
    without = TOML[: TOML.index("[gripper]")] + TOML[TOML.index("[collision]") :]
    assert load_robot(written(tmp_path, without, urdf=just)).joint("joint_5").velocity == 10.0


def test_our_firmware_speaks_at_one_speed_only(tmp_path: Path) -> None:
    ours = replaced(TOML, 'firmware = "stock"', 'firmware = "armtree"')
    assert load_robot(written(tmp_path, ours)).serial.baud == 115200
    said = refusal(written(tmp_path, replaced(ours, "baud = 115200", "baud = 9600")))
    assert "serial.baud: 9600 is not 115200, the speed of armtree\n" in said


def test_a_urdf_with_thousands_of_links(tmp_path: Path) -> None:
    """Reading takes time that grows in proportion to them, and there is a limit."""

    def urdf(count: int) -> str:
        links = "".join(f'<link name="extra_{i}"/>' for i in range(count))
        fixed = "".join(
            f'<joint name="fixed_{i}" type="fixed"><parent link="extra_{i + 1}"/>'
            f'<child link="extra_{i}"/></joint>'
            for i in range(count - 1)
        )
        last = f'<parent link="base_link"/><child link="extra_{count - 1}"/>'
        fixed += f'<joint name="fixed" type="fixed">{last}</joint>'
        return replaced(URDF, "</robot>", f"{links}{fixed}</robot>")

    own = len(load_robot().links)
    assert len(load_robot(written(tmp_path, urdf=urdf(1000 - own))).links) == 1000
    said = refusal(written(tmp_path, urdf=urdf(3000)))
    assert said.endswith(f"has {3000 + own} links; the limit is 1000")


def test_a_robot_file_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "z1.toml").touch()
    make = r"is a URDF, not a robot file; make a robot file with `armtree new-arm .*arm\.urdf`"
    with pytest.raises(DescriptionError, match=make):
        load_robot(tmp_path / "arm.urdf")
    none = "there is no such file, and no shipped robot of that name; the shipped robots are arduinobot, so101"
    for name, near in (("none", ""), ("z1", tmp_path / "z1.toml"), ("s101.toml", "so101")):
        more = f"did you mean {near}?" if near else "`armtree new-arm` makes one from a URDF"
        wanted = f"{none}; {more}"
        assert refusal(tmp_path / name).endswith(wanted)
    assert "cannot be read: Is a directory" in refusal(tmp_path)
    (tmp_path / "latin").write_bytes(b"name = '\xe4'")
    assert "is not UTF-8" in refusal(tmp_path / "latin")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.data())
def test_whatever_a_value_is_the_file_loads_or_is_refused(
    tmp_path: Path, data: st.DataObject
) -> None:
    """No value of any key escapes as another error."""
    keys = re.findall(r"^(\w+) = (.*?)(?:\s+#.*)?$", TOML, re.MULTILINE)
    lines = [f"{key} = {value}" for key, value in keys if not value.startswith("[ ")]
    old = data.draw(st.sampled_from(lines))
    values = ["0", "-1", "1e308", "1e-308", "-inf", "nan", "true", '""', '"x"', "[]", "{}", "[[]]",
              "1979-05-27", "[1]", '["joint_1"]', str(10**400), '"\\u0000"']  # fmt: skip
    new = f"{old.partition(' = ')[0]} = {data.draw(st.sampled_from(values))}"
    try:
        assert isinstance(load_robot(written(tmp_path, replaced(TOML, old, new))), Robot)
    except DescriptionError as error:
        place = error.path
    else:
        place = tmp_path / "robot.toml"
    assert place.parent == tmp_path


OTHER_TOML = """
name = "pan-tilt"
driver = "serial_servo"
urdf = "pan_tilt.urdf"

[serial]
baud = 9600
boot_wait_s = 1.5
firmware = "stock"

[groups]
arm = ["pan", "tilt"]

[joints.tilt]
velocity = 2.0
acceleration = 1.0
boot = -0.5
wire = { letter = "t", sign = -1, offset_deg = 90, span_deg = 180, reversed = true }

[joints.pan]
velocity = 2
acceleration = 1
boot = 0
wire = { letter = "p", sign = 1, offset_deg = 135, span_deg = 270, reversed = false }

[collision]
margin_m = 0
allowed = []
floor_ignores = []
"""
OTHER_URDF = """<?xml version="1.0"?>
<robot name="pan_tilt">
  <link name="base"/><link name="neck"/><link name="camera"/><link name="eye"/>
  <joint name="pan" type="revolute">
    <parent link="base"/><child link="neck"/><axis xyz="0 0 1"/>
    <limit lower="-2.3" upper="2.3" effort="1" velocity="2"/>
  </joint>
  <joint name="tilt" type="revolute">
    <parent link="neck"/><child link="camera"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="2"/>
  </joint>
  <joint name="lens" type="fixed"><parent link="camera"/><child link="eye"/></joint>
</robot>
"""


def test_another_arm_is_another_file(tmp_path: Path) -> None:
    (tmp_path / "pan_tilt.urdf").write_text(OTHER_URDF)
    (tmp_path / "pan_tilt.toml").write_text(OTHER_TOML)
    robot = load_robot(tmp_path / "pan_tilt.toml")
    assert [joint.name for joint in robot.actuated] == ["tilt", "pan"]
    assert robot.serial.port == ""
    assert robot.collision.floor is None
    codec = Codec(robot.actuated)
    assert str(codec.encode(robot.boot_pose)) == f"t{180 - int(90 + math.degrees(0.5)):03d},p090,"
    for angles in ([33, 0], [147, 180], [90, 90]):
        frame = codec.frame(angles)
        assert codec.encode(codec.decode(frame)).servos[0] == angles[0]


@pytest.mark.parametrize(
    ("letters", "has"), [("bsex", "b, s, e, x"), ("bseg", ""), ("sbeg", "s, b, e, g")]
)
def test_our_firmware_has_its_own_letters(tmp_path: Path, letters: str, has: str) -> None:
    toml = replaced(TOML, 'firmware = "stock"', 'firmware = "armtree"')
    new = iter(letters)
    path = written(tmp_path, re.sub('letter = "."', lambda _: f'letter = "{next(new)}"', toml))
    if not has:
        assert load_robot(path).firmware.name == "armtree"
        return
    line = 1 + toml[: toml.index("firmware =")].count("\n")
    knows = "armtree has servos b, s, e, g, in this order; the joints here have"
    then = "Change the letters, or flash another firmware"
    assert refusal(path).startswith(f"{path}:{line}: serial.firmware: {knows} {has}. {then}\n")


def test_our_firmware_has_four_servos(tmp_path: Path) -> None:
    said = refusal(chain(tmp_path, 2, "armtree"))
    assert "serial.firmware: armtree has servos b, s, e, g, in this order; the joints" in said


def chain(folder: Path, count: int, firmware: str) -> Path:
    """A robot file with this many equal joints."""
    joint = (
        '<joint name="j{0}" type="revolute"><parent link="l{0}"/><child link="l{1}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="2"/></joint>'
    )
    links = "".join(f'<link name="l{n}"/>' for n in range(count + 1))
    joints = "".join(joint.format(n, n + 1) for n in range(count))
    (folder / "pan_tilt.urdf").write_text(f'<robot name="chain">{links}{joints}</robot>')
    head, _, tail = OTHER_TOML.partition("[joints.tilt]")
    table = "[joints.j{}]\nvelocity = 1\nacceleration = 1\nboot = 0\n{}\n"
    names = [f"j{n}" for n in range(count)]
    head = replaced(head, '["pan", "tilt"]', str(names).replace("'", '"'))
    head = replaced(head, '"stock"', f'"{firmware}"')
    tables = [
        table.format(n, replaced(WIRE_1, '"b"', f'"{letter}"'))
        for n, letter in zip(range(count), "besgxyz", strict=False)
    ]
    path = folder / "chain.toml"
    path.write_text(head + "".join(tables) + tail[tail.index("[collision]") :])
    return path


def test_six_joints_at_the_most_let_a_stop_fit_the_sketch(tmp_path: Path) -> None:
    assert len(load_robot(chain(tmp_path, 6, "stock")).actuated) == 6
    said = refusal(chain(tmp_path, 7, "stock"))
    assert "joints: frames of 7 joints are too long for the 63 bytes that stock can store" in said


def test_a_robot_is_pickled_while_another_thread_caches_a_property() -> None:
    class Caches:
        """Stands for the other thread, in the middle of the pickling."""

        def __reduce__(self) -> tuple[type[int], tuple[()]]:
            assert robot.wire_format
            return int, ()

    robot = replace(SHIPPED, name=cast("str", Caches()))
    assert pickle.loads(pickle.dumps(robot)).joints == SHIPPED.joints
