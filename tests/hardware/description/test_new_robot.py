"""Robot files that are made from URDFs."""

import re
import tomllib
from pathlib import Path
from struct import pack

import pytest

from hardware import DescriptionError, load_robot
from hardware.description.new_robot import (
    UrdfUnusable,
    draft_robot,
    guess_gripper_poses,
    robot_text,
)
from tests.support.arms.urdfs import urdf
from tests.support.paths import DATA

LARGEST = 1e6
ARM = ["base -> a: revolute shoulder", "a -> b: continuous elbow", "b -> c: prismatic lift"]


def written(folder: Path, text: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(text)
    return path


def mistakes(path: Path) -> list[str]:
    """What is wrong with a URDF, with the lines but without the path, which is asserted here."""
    with pytest.raises(UrdfUnusable) as caught:
        draft_robot(path, LARGEST)
    first, *lines = str(caught.value).splitlines()
    assert first == f"{path}: {len(lines)} mistakes"
    return [line.removeprefix(f"{path}:") for line in lines]


def made(path: Path) -> Path:
    output = path.with_suffix(".toml")
    output.write_text(robot_text(draft_robot(path, LARGEST), path.parent, {}))
    return output


@pytest.mark.parametrize("name", ["three_axes", "seven_axes", "endless"])
def test_what_is_written_is_read_as_the_draft(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, (DATA / f"{name}.urdf").read_text())
    draft, robot = draft_robot(path, LARGEST), load_robot(made(path))
    assert robot.groups == draft.groups
    assert {joint.name: joint for joint in robot.joints} == {j.name: j for j in draft.joints}
    assert (robot.tool, robot.links, robot.has_driver) == (draft.tool, draft.links, False)


def test_limits_are_those_of_the_urdf_unless_they_are_placeholders(tmp_path: Path) -> None:
    limits = '<limit lower="0.5" upper="1" velocity="{}" effort="1"/>'
    joints = [f"base -> a: revolute slow {limits.format(0.7)}"]
    joints += [f"a -> b: revolute fast {limits.format(100)}", "b -> c: continuous free"]
    joints += [f"c -> d: revolute none {limits.format(0)}"]
    joints += [f'd -> e: revolute rod {limits.format(0)} <mimic joint="slow"/>']
    by_name = {j.name: j for j in load_robot(made(written(tmp_path, urdf(joints)))).joints}
    velocities = {name: joint.velocity for name, joint in by_name.items()}
    assert velocities == {"slow": 0.7, "fast": 1.0, "free": 1.0, "none": 1.0, "rod": 0.7}
    assert (by_name["slow"].boot, by_name["free"].boot) == (0.5, 0.0)


@pytest.mark.parametrize("velocity", [0.628318530718, 1e-7, 0.00004, 3.14159265359])
def test_no_number_is_rounded_beyond_a_limit(tmp_path: Path, velocity: float) -> None:
    limit = f'<limit lower="0.123456" upper="0.123457" velocity="{velocity}" effort="1"/>'
    robot = load_robot(made(written(tmp_path, urdf([f"base -> a: revolute narrow {limit}"]))))
    assert robot.joint("narrow").velocity == pytest.approx(velocity, rel=1e-3)
    assert robot.joint("narrow").boot == 0.123456


def test_a_leader_is_no_faster_than_its_follower_may_be(tmp_path: Path) -> None:
    mimic = '<mimic joint="shoulder" multiplier="-4"/>'
    path = written(tmp_path, urdf([*ARM, f"base -> d: revolute rod {mimic}"]))
    assert load_robot(made(path)).joint("shoulder").velocity == 0.5


@pytest.mark.parametrize("driver", ["feetech", "serial_servo"])
def test_the_comments_are_a_board_that_only_wants_its_values(tmp_path: Path, driver: str) -> None:
    path = made(written(tmp_path, urdf(["base -> a: revolute shoulder"])))
    text = re.sub(r"(?m)^# (?=driver|\[|port|baud|boot|firm|wire|floor)", "", path.read_text())
    assert tomllib.loads(text)["collision"]["floor_m"] == 0.0
    head = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#  "))
    row = re.search(rf'"{driver}".*?(\d+) +("\w+").*?(\{{.*?\}})', head)
    assert row
    for key, value in zip(("baud = 0", 'firmware = ""', "wire = {}"), row.groups(), strict=True):
        text = text.replace(key, f"{key.partition(' ')[0]} = {value}")
    path.write_text(text.replace('driver = ""', f'driver = "{driver}"'))
    assert load_robot(path).has_driver


def test_the_urdf_is_found_from_the_robot_file_in_a_moved_folder(tmp_path: Path) -> None:
    (tmp_path / "real/a/b/c/d").mkdir(parents=True)
    (tmp_path / "link").symlink_to("real/a/b/c/d")
    path = written(tmp_path / "real", urdf(ARM))
    (tmp_path / "link/arm.toml").write_text(
        robot_text(draft_robot(path, LARGEST), tmp_path / "link", {})
    )
    (tmp_path / "real").rename(tmp_path / "moved")
    assert load_robot(tmp_path / "moved/a/b/c/d/arm.toml").actuated


def test_a_gripper_is_closed_at_the_limit_nearer_to_0(tmp_path: Path) -> None:
    limits = {"left": (-0.1, 1.5), "right": (-0.8, 0.0), "thumb": (0.0, 0.0)}
    limit = '<limit lower="{}" upper="{}" velocity="1" effort="1"/>'
    joints = [
        f"b -> {each}: revolute {each} {limit.format(lower, upper)}"
        for each, (lower, upper) in limits.items()
    ]
    path = written(tmp_path, urdf([*ARM[:2], *joints, "b -> e: continuous finger"]))
    draft = draft_robot(path, LARGEST, [*limits, "finger"])
    assert guess_gripper_poses(draft) == {
        "open": {"left": 1.5, "right": -0.8, "thumb": 0.0},
        "closed": {"left": -0.1, "right": 0.0, "thumb": 0.0},
    }
    assert guess_gripper_poses(draft_robot(path, LARGEST, ["finger"])) == {}


def test_names_that_toml_must_quote(tmp_path: Path) -> None:
    path = written(tmp_path, urdf(ARM).replace("shoulder", "the shoulder.1"))
    assert load_robot(made(path)).actuated[0].name == "the shoulder.1"


def test_limits_in_degrees_are_reported(tmp_path: Path) -> None:
    limit = '<limit lower="{}" upper="{}" velocity="1" effort="1"/>'
    limits = [("-90", "90"), ("0", "172.5"), ("-6.28318", "6.28318"), ("-1e16", "1e16")]
    limits += [("-1.8", "180"), ("-90", "1.8326")]
    joints = [f"{n} -> {n + 1}: revolute j{n} {limit.format(*q)}" for n, q in enumerate(limits)]
    said = "1: joint {}: its limit{} like degrees, but a URDF has radians; write {}"
    assert mistakes(written(tmp_path, urdf(joints))) == [
        said.format("j0", "s -90 and 90 look", 'lower="-1.5708" upper="1.5708"'),
        said.format("j1", " 172.5 looks", 'lower="0" upper="3.0107"'),
        said.format("j4", " 180 looks", 'lower="-1.8" upper="3.1416"'),
        said.format("j5", " -90 looks", 'lower="-1.5708" upper="1.8326"'),
    ]


def test_origins_in_mm_are_reported(tmp_path: Path) -> None:
    joints = ['base -> a: revolute j <origin xyz="0 -50 250"/>', "a -> b: revolute k"]
    said = r'joint j: its origin 0 -50 250 looks like mm, .* write xyz="0 -0.05 0.25"$'
    with pytest.raises(UrdfUnusable, match=said):
        draft_robot(written(tmp_path, urdf(joints)), LARGEST)


@pytest.mark.parametrize("end", ["child", "parent"])
def test_a_misspelt_link_of_a_joint_is_one_mistake(tmp_path: Path, end: str) -> None:
    joints = ["base -> arm: revolute j", "arm -> wrist: revolute k", "wrist -> hand: revolute l"]
    text = urdf(joints).replace(f'<{end} link="wrist"/>', f'<{end} link="wirst"/>')
    with pytest.raises(UrdfUnusable) as caught:
        draft_robot(written(tmp_path, text), LARGEST)
    names = "there are arm, base, hand, wrist; did you mean wrist?"
    joint = {"child": "k", "parent": "l"}[end]
    said = f"arm.urdf:1: joint {joint}: its {end} wirst is not a link; {names}"
    assert str(caught.value).endswith(said)


def test_limits_and_shapes_in_mm_are_reported(tmp_path: Path) -> None:
    limit = '<limit lower="{}" upper="{}" velocity="1" effort="1"/>'
    limits = ("0", "20"), ("-0.5", "5"), ("-1e16", "1e16")
    joints = [f"{n} -> {n + 1}: prismatic j{n} {limit.format(*q)}" for n, q in enumerate(limits)]
    joints += ["3 -> 4: fixed weld"]
    geometry = "<geometry>{}</geometry>"
    body = {
        0: "<collision>{}</collision>\n".format(geometry.format('<box size="100 100 50"/>')),
        1: "<visual>{}</visual>".format(geometry.format('<sphere radius="60"/>')),
        2: "<visual>{}</visual>".format(geometry.format('<cylinder radius="2" length="15"/>')),
    }
    text = urdf(joints)
    for link, shapes in body.items():
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{shapes}')
    assert mistakes(written(tmp_path, text)) == [
        "2: joint j0: its limits 0 and 20 look like mm, but a URDF has metres; "
        'write lower="0" upper="0.02"',
        "1: the size of the box of 0, 100 100 50, looks like mm, but a URDF has metres; "
        'write size="0.1 0.1 0.05"',
        "2: the radius of the sphere of 1, 60, looks like mm, but a URDF has metres; "
        'write radius="0.06"',
    ]


def test_a_mesh_in_mm_is_found_beside_other_mistakes(tmp_path: Path) -> None:
    corners = (0.0, 0.0, 0.0), (0.0, 0.0, 200.0), (0.0, 30.0, 0.0)
    triangle = pack("<12fH", 0.0, 0.0, 1.0, *(x for corner in corners for x in corner), 0)
    (tmp_path / "upper.stl").write_bytes(bytes(80) + pack("<I", 1) + triangle)
    mesh = '<collision><geometry>\n<mesh filename="upper.stl"/></geometry></collision>'
    text = urdf([*ARM, 'c -> d: prismatic slide <limit lower="0" upper="20"/>'])
    text = text.replace('<link name="a">', f'<link name="a">{mesh}')
    assert [line.partition("write")[0] for line in mistakes(written(tmp_path, text))][-1:] == [
        "2: the mesh upper.stl is 200 m long, which looks like mm; "
    ]
    scaled = text.replace('"upper.stl"', '"upper.stl" scale="0.001 0.001 0.001"')
    assert not any("mesh" in line for line in mistakes(written(tmp_path, scaled)))


def test_a_name_that_two_joints_have_hides_no_mistake(tmp_path: Path) -> None:
    joints = ["base -> a: revolute j", "a -> b: revolute j", "b -> b: revolute k"]
    joints += ['c -> d: revolute j <mimic joint="l"/>', "b -> c: fixed weld"]
    joints += ['c -> e: revolute j <mimic joint="m"/>', "b -> e: fixed weld"]
    path = written(tmp_path, urdf(joints).replace("<joint", "\n<joint"))
    assert [line.partition(";")[0] for line in mistakes(path)] == [
        "3: two joints are called j",
        "8: two joints are called weld",
        "4: joint k: its child b is already the child of j (2)",
        "8: joint weld (2): its child e is already the child of j (4)",
        "4: joint k has the same link as parent and child, b",
        "5: joint j mimics l, which does not move by itself",
        "7: joint j mimics m, which does not move by itself",
    ]
    robot = tmp_path / "arm.toml"
    robot.write_text(f"name = 'arm'\nurdf = '{path.name}'\n")
    with pytest.raises(
        DescriptionError, match=rf"5 mistakes\n(.*\n)+{path}:4: joint k has the same link"
    ):
        load_robot(robot)


def test_everything_that_is_wrong_is_reported_at_once(tmp_path: Path) -> None:
    shapes = '<collision><geometry><mesh filename="package://p/m.stl"/></geometry></collision>'
    shapes += '<collision><geometry><box size="0 1 1"/></geometry></collision>'
    shapes = shapes.replace("<geometry><box", '<origin rpy="0"/><geometry><box')
    limit = '<limit lower="0" velocity="0" effort="1"/><axis xyz="0 0 0"/>'
    joints = [ARM[0].replace("revolute", "screw"), f"a -> b: prismatic lift {limit}"]
    text = urdf(joints, shapes)
    for tag in ("<joint", "<limit", "<axis"):
        text = text.replace(tag, f"\n{tag}")
    with pytest.raises(UrdfUnusable) as caught:
        draft_robot(written(tmp_path, text), LARGEST, ["left"], "hand")
    words = str(caught.value).splitlines()
    assert words[0].endswith("arm.urdf: 12 mistakes")
    assert [line.partition(";")[0].removeprefix(f"{tmp_path}/") for line in words[1:]] == [
        "arm.urdf:2: joint shoulder is screw",
        "arm.urdf:4: joint lift: the upper of its limit is missing",
        "arm.urdf:5: joint lift: its axis is '0 0 0'",
        *(
            f"arm.urdf:1: the {what} of {link} is {value}"
            for link in ("base", "a", "b")
            for what, value in (("rpy of an origin", "'0'"), ("size of the box", "'0 1 1'"))
        ),
        "the mesh package://p/m.stl is not found",
        "--gripper: left is not a joint that moves by itself",
        "there is no link hand for the tool",
    ]


def test_meshes_for_viewers_are_named_beside_a_mistake(tmp_path: Path) -> None:
    shapes = '<visual><geometry><mesh filename="package://nobot/m.stl"/></geometry></visual>'
    path = written(tmp_path, urdf(ARM, shapes))
    assert draft_robot(path, LARGEST)
    path.write_text(path.read_text().replace('<child link="a"/>', '<child link="x"/>'))
    with pytest.raises(UrdfUnusable, match=r"x is not a link[\s\S]*nobot/m\.stl is not found; "):
        draft_robot(path, LARGEST)


def test_elements_of_entities_have_a_line(tmp_path: Path) -> None:
    text = urdf([*ARM, "c -> d: screw j"]).replace("</robot>", "&more;</robot>")
    types = '<!DOCTYPE robot [<!ENTITY more "<!-- a --><link/><link/>">]>\n'
    path = written(tmp_path, types + text)
    assert [line.partition(";")[0] for line in mistakes(path)][:2] == [
        "2: link 6 of 7 has no name",
        "2: joint j is screw",
    ]


WRONG = {
    "no XML": ("<robot", ":1: is not XML"),
    "other XML": ("<sdf/>", "is not a URDF: its root element is <sdf>"),
    "xacro": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="x"/></robot>',
        "arm.urdf: is a xacro file; first run xacro FILE > robot.urdf",
    ),
    "xacro of another address": (
        '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="x"/></robot>',
        "arm.urdf: is a xacro file",
    ),
    "xacro without its elements": (
        urdf([f'{ARM[0]} <origin xyz="0 0 ${{a*0.065}}"/>']),
        "arm.urdf: is a xacro file",
    ),
    "a loop": (urdf(["a -> b: fixed j", "b -> a: fixed k"]), "joint j is its own ancestor"),
    "no name, nor links": (
        "<robot/>",
        'arm.urdf:1: the robot has no name; write <robot name="my_arm">\nhas no links',
    ),
    "two roots": (urdf([ARM[0], "x -> y: fixed j"]), "links base and x have no parent joint"),
    "follows nothing": (
        urdf([*ARM, 'c -> d: revolute rod <mimic joint="none"/>']),
        "joint rod mimics none, which does not move by itself; let it mimic one of shoulder",
    ),
    "follows with 0": (
        urdf([*ARM, 'c -> d: revolute rod <mimic joint="lift" multiplier="0"/>']),
        "with multiplier 0; give another multiplier",
    ),
}


@pytest.mark.parametrize(("text", "why"), WRONG.values(), ids=WRONG)
def test_a_urdf_that_is_wrong(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(UrdfUnusable, match=re.escape(why)):
        draft_robot(written(tmp_path, text), LARGEST)


def test_all_wrong_names_are_reported_at_once(tmp_path: Path) -> None:
    with pytest.raises(UrdfUnusable, match=r"3 mistakes\n.*left.*\n.*right.*\n.*no link hand"):
        draft_robot(written(tmp_path, urdf(ARM)), LARGEST, ["left", "right", "lift"], "hand")


def test_names_that_the_urdf_does_not_have(tmp_path: Path) -> None:
    path = written(tmp_path, urdf(ARM))
    assert draft_robot(path, LARGEST, ["lift"], "a").groups["gripper"] == ("lift",)
    text = urdf([*ARM, 'c -> d: prismatic right_jaw <mimic joint="lift"/>'])
    path = written(tmp_path, text)
    for gripper, tool, why in (
        (
            ["shouldr"],
            "a",
            "--gripper: shouldr is not a joint that moves by itself; did you mean s",
        ),
        (["righ_jaw"], "a", "righ_jaw is not a joint that moves by itself; did you mean lift.$"),
        (["thumb"], "a", "--gripper: thumb is not a joint that moves by itself; there are elbow"),
        (["shoulder", "elbow", "lift"], "a", "leave at least one for the arm"),
        ([], "hand", "there is no link hand for the tool; there are a, b, base, c"),
    ):
        with pytest.raises(UrdfUnusable, match=why):
            draft_robot(path, LARGEST, gripper, tool)
