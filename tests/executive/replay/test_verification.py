"""Verification: runs with any outcome hold, and every change is found with its source."""

import multiprocessing
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pytest

import logs
from executive.replay.verification import Verification, verify, verify_all
from logs import Recording
from logs.records.cdr import decode, encode
from tests.conftest import Rig, RigMaker
from tests.executive.test_executive import reach
from tests.support.paths import DATA
from tests.support.recordings.alterations import (
    Change,
    altered,
    each,
    lacking,
    moved,
    replace,
    retold,
)

pytestmark = pytest.mark.slow


def picked(rig: Rig) -> Path:
    (outcome,) = rig.run(1)
    assert outcome.success
    return Path(outcome.recording)


def checks(verification: Verification) -> list[bool]:
    return [check.holds for check in verification.checks]


def test_a_run_of_several_tasks_holds(rig: RigMaker) -> None:
    for outcome in rig().run(0, 1, 2, 0):
        verification = verify(Path(outcome.recording))
        assert verification.holds, verification.text()
        assert verification.motion > 1.0


def test_a_canceled_run_holds_with_its_hold_frame(rig: RigMaker) -> None:
    arm = rig()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 4:
            arm.soon(arm.cancel)

    arm.on_record = watch
    (outcome,) = arm.run(1)
    verification = verify(Path(outcome.recording))
    assert outcome.state.name == "CANCELED"
    assert any(record.hold for record in arm.recorded(logs.Sent))
    assert verification.holds, verification.text()


def test_a_run_that_was_held_up_holds(rig: RigMaker) -> None:
    """If a frame is sent more than a period late, all later frames are due later, too."""
    arm, sent = rig(), count(1)
    arm.on_record = lambda record: (
        arm.rest(0.35) if isinstance(record, logs.Sent) and next(sent) == 4 else None
    )
    verification = verify(picked(arm))
    late = [record.time - (record.scheduled or 0.0) for record in arm.recorded(logs.Sent)]
    assert max(late) > 0.2
    assert max(late[6:]) < 0.01
    assert verification.holds, verification.text()


def test_a_file_cut_before_its_first_record_is_cut_and_not_changed(rig: RigMaker) -> None:
    path = picked(rig())
    path.write_bytes(path.read_bytes()[:32_000])  # in the first chunk, after the robot
    verification = verify(path)
    assert (checks(verification), verification.code) == ([True, True], "log.truncated")
    logs.recover(path)
    verification = verify(path)
    assert (checks(verification), verification.code) == ([True, True], "log.cut")
    assert "holds" not in verification.text()
    assert "nothing to verify: the file was cut before the first record" in verification.text()
    assert "complete" not in verification.text()


def test_a_run_without_a_motion_has_nothing_to_verify(rig: RigMaker, tmp_path: Path) -> None:
    task = "task: 9\nname: no\ndescription: Nothing moves.\ntree:\n  Fail: {reason: no}\n"
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "9_no.yaml").write_text(task)
    (outcome,) = rig(tmp_path / "tasks").run(9)
    assert not outcome.success
    verification = verify(Path(outcome.recording))
    assert verification.holds
    assert verification.text().splitlines()[1:] == [
        "  plan -> frames  -        nothing to verify: the recording has no frame",
        "  goal -> plan    -        nothing to verify: the recording has no plan",
        "  the file is complete and unchanged, and its messages agree",
    ]


def test_a_run_that_found_no_plan_holds(rig: RigMaker, tmp_path: Path) -> None:
    tasks = tmp_path / "tasks"
    tasks.mkdir()
    reach(tasks, 8, (0.0, -1.5, -1.2))
    (outcome,) = rig(tasks).run(8)
    assert outcome.code == "plan.goal_in_collision"
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()


@pytest.mark.parametrize(
    ("kind", "old", "new", "held", "words"),
    [
        ("Message", b"b089,", b"b088,", [False, True], "frame 1: b088"),  # in /schedule
        ("Message", b'"seed":1', b'"seed":2', [True, False], "seed: the goal has 2"),
        ("Attachment", b"velocity = 1.0", b"velocity = 1.1", [True, False], "description: "),
        (
            "Attachment",
            b'"joint_1": -1.4',
            b'"joint_1": -1.3',
            [True, False],
            "task: it moves joint_1 to",
        ),
        ("Message", b'"goal":[-1.4', b'"goal":[-1.3', [True, False], "task: it moves joint_1 to"),
        ("Message", b'"velocity_limits":[1.0', b'"velocity_limits":[1.1', [True, False], "limits"),
        ("Message", b'"task":1', b'"task":2', [False, True], "but its goal is not recorded"),
        ("Message", b'"firmware":"stock', b'"firmware":"stuck', [False, True], "schedule of firm"),
        ("Message", b'"rate_hz":10.0', b'"rate_hz":50.0', [False, True], "schedule of rate_hz"),
        ("Message", b'"delays_s":[0.0', b'"delays_s":[0.1', [False, True], "delays_s"),
        ("Message", b'"slowed_s":0.0', b'"slowed_s":0.5', [False, True], "slowed_s"),
        ("Message", b'"start":{"joint_1":0.0', b'"start":{"joint_1":0.1', [True, False], ""),
        ("Message", b'"frames":31', b'"frames":30', [False, True], "counts 30 frames, but 31"),
    ],
)
def test_every_change_is_found_with_its_source(
    rig: RigMaker, kind: str, old: bytes, new: bytes, held: list[bool], words: str
) -> None:
    verification = verify(altered(picked(rig()), replace(kind, old, new)))
    assert checks(verification) == held
    assert words in verification.text()


def test_a_frame_that_was_due_at_another_time(rig: RigMaker) -> None:
    path = picked(rig())
    sent = next(r for r in logs.Recording(path).records(logs.Sent) if isinstance(r, logs.Sent))
    first = f"{sent.scheduled!r}"[0]
    other = "2" if first in "01" else "1"
    old, new = (f'"scheduled":{digit}'.encode() for digit in (first, other))
    verification = verify(altered(path, replace("Message", old, new)))
    assert checks(verification) == [False, True]
    assert "was due" in verification.text()


def test_a_frame_whose_time_was_changed(rig: RigMaker) -> None:
    path = picked(rig())
    changes = (("time", 0.5, True), ("time", -0.5, True), ("time", 0.001, False))
    for number in (1, 16, 31):
        for change in (*changes, ("scheduled", 0.5, False), ("scheduled", -0.5, False)):
            verification = verify(altered(path, moved(number, *change)))
            assert checks(verification) == [False, True], (number, change, verification.text())


def test_one_byte_of_one_frame_that_was_sent(rig: RigMaker) -> None:
    def change(record: Any) -> None:
        record.data = record.data.replace(b"b080,", b"b081,", 1)

    verification = verify(altered(picked(rig()), each(["/serial/tx"], change)))
    assert checks(verification) == [False, True]
    assert "b081," in verification.text()


def test_positions_that_a_frame_does_not_command(rig: RigMaker) -> None:
    def turn(record: Any) -> None:
        state = decode("sensor_msgs/msg/JointState", record.data)
        state.position = (state.position[0] - 0.1, *state.position[1:])
        record.data = encode("sensor_msgs/msg/JointState", state)

    verification = verify(altered(picked(rig()), each(["/joint_states"], turn, 5)))
    assert checks(verification) == [False, True]
    assert "was sent for positions that encode to" in verification.text()


def test_a_frame_that_is_missing(rig: RigMaker) -> None:
    seen = 0
    channels = {}

    def change(record: Any) -> None:
        nonlocal seen
        kind = type(record).__name__
        if kind == "Channel":
            channels[record.id] = record.topic
        elif kind == "Message" and channels[record.channel_id].startswith(("/serial", "/joint")):
            seen += 1
            if seen > 3 * 20:  # the rest was not sent, but the result is SUCCEEDED
                record.channel_id = next(i for i, t in channels.items() if t == "/rosout")

    path = altered(picked(rig()), change)
    with pytest.raises(logs.RecordingError):
        list(logs.Recording(path).records(logs.LogLine))
    verification = verify(path)
    assert checks(verification) == [False, True]
    assert "frame 21" in verification.text()
    assert "none was sent" in verification.text()


@pytest.mark.parametrize(
    ("topics", "held", "words"),
    [
        (["/"], [False, True], "nothing is recorded"),
        (["/goal", "/result"], [False, True], "no goal is recorded"),
        (
            ["/plan/arm"],
            [True, False],
            "a schedule moves the group arm, but no plan for it is recorded",
        ),
        (["/schedule"], [False, True], "was sent without a schedule"),
    ],
)
def test_a_missing_record_is_a_difference(
    rig: RigMaker, topics: list[str], held: list[bool], words: str
) -> None:
    verification = verify(lacking(picked(rig()), *topics))
    assert checks(verification) == held, verification.text()
    assert words in verification.text()


def field(*places: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    """Sets the value at a path of a message's fields."""

    def change(fields: Any) -> None:
        for place in places[:-1]:
            fields = fields[place]
        fields[places[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "held", "words"),
    [
        (
            retold("/plan/arm", field("code", to="plan.timeout")),
            [True, False],
            "no plan for it is reco",
        ),
        (
            retold("/plan/arm", field("duration", to=9.0)),
            [True, False],
            "duration 9.0 s is recorded",
        ),
        (retold("/plan/arm", field("positions", 5, 0, to=9.0)), [True, False], "sample 6: joint_1"),
        (
            retold("/schedule", field("duration", to=9.0)),
            [False, False],
            "motion of 9.0 s is recor",
        ),
        (
            retold("/schedule", field("start", "joint_1", to=0.1)),
            [True, False],
            "at another position",
        ),
        (
            retold("/schedule", field("samples", 5, 0, to=0.1)),
            [False, False],
            "merged sample 6: jo",
        ),
        (retold("/serial/timing", field("hold", to=True)), [False, True], "sent after the hold"),
        (retold("/serial/timing", field("hold", to=True), 6), [False, True], "does not repeat"),
    ],
)
def test_a_recorded_motion_is_compared_with_the_one_compiled_again(
    rig: RigMaker, change: Change, held: list[bool], words: str
) -> None:
    verification = verify(altered(picked(rig()), change))
    assert checks(verification) == held, verification.text()
    assert words in verification.text()


def test_a_branch_that_failed_later_does_not_excuse_frames_that_are_missing(
    rig: RigMaker, tmp_path: Path
) -> None:
    tasks = tmp_path / "tasks"
    tasks.mkdir()
    (tasks / "7_later.yaml").write_text(LATER)
    (outcome,) = rig(tasks).run(7)
    assert outcome.success, outcome.message
    path = Path(outcome.recording)
    assert verify(path).holds
    verification = verify(lacking(path, "/serial", "/joint_states", after=3 * 4))
    assert checks(verification) == [False, True]
    assert "frame 5" in verification.text()
    assert "none was sent" in verification.text()


LATER = """task: 7
name: later
description: Move, then fail and recover.
tree:
  selector:
    - sequence:
        - subtree: reach
          with: {arm: {joint_1: -0.5, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0}}
        - Fail: {reason: the thing is not there}
    - Succeed
"""


def test_new_versions_are_named_as_the_source(rig: RigMaker) -> None:
    def change(record: Any) -> None:
        if type(record).__name__ == "Metadata" and record.name == "versions":
            record.metadata = {**record.metadata, "pin": "1.9.9"}

    path = altered(picked(rig()), change)
    verification = verify(path)
    assert checks(verification) == [True, True]
    assert "also with pin" in verification.checks[1].words
    other = altered(path, replace("Message", b'"waypoints":[[0.0', b'"waypoints":[[0.1'))
    verification = verify(other)
    assert checks(verification) == [True, False]
    assert "instead of 1.9.9" in verification.checks[1].source
    assert (
        "waypoint 1: joint_1 = 0.1 rad is recorded, but now it is 0.0 rad"
        in verification.checks[1].words
    )


def test_a_cut_file_is_checked_up_to_the_cut_and_does_not_hold(rig: RigMaker) -> None:
    path = picked(rig())
    path.write_bytes(path.read_bytes()[:-100])
    verification = verify(path)
    assert not verification.holds
    assert checks(verification) == [True, True]
    assert verification.code == "log.truncated"


def test_results_of_many_files_keep_their_order(rig: RigMaker, tmp_path: Path) -> None:
    paths = [Path(outcome.recording) for outcome in rig().run(0, 1, 2)]
    paths.insert(1, tmp_path / "nope.mcap")
    verifications = list(verify_all(paths, 2))
    assert [verification.path for verification in verifications] == paths
    assert [verification.holds for verification in verifications] == [True, False, True, True]
    assert verifications[1].code == "log.unreadable"


def test_ctrl_c_does_not_reach_the_processes_that_verify(rig: RigMaker) -> None:
    path = picked(rig())
    verifications = verify_all([path], 1)
    assert next(verifications).holds
    (worker,) = multiprocessing.active_children()
    status = Path(f"/proc/{worker.pid}/status").read_text()
    blocked = int(re.findall(r"SigBlk:\s+(\w+)", status)[0], 16)
    assert blocked & 1 << signal.SIGINT - 1
    assert list(verifications) == []


VERIFIES = """
import multiprocessing, sys
from pathlib import Path
from executive.replay.verification import verify_all
verifications = verify_all([Path(sys.argv[1])], 1)
next(verifications)
print(multiprocessing.active_children()[0].pid, flush=True)
sys.stdin.read()
"""


def test_the_processes_that_verify_end_with_a_killed_parent(rig: RigMaker) -> None:
    command = sys.executable, "-c", VERIFIES, str(picked(rig()))
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout
        worker = os.pidfd_open(int(parent.stdout.readline()))
        parent.kill()
    ended = select.select([worker], [], [], 20.0)[0]
    os.close(worker)
    assert ended == [worker]


AROUND = """task: 7
name: around
description: Round a post, by way of a point.
tree:
  sequence:
    - AddBox: {body: post, size: [3 cm, 30 mm, 0.2], position: [0.115, 0.115, 0.1]}
    - AddSphere: {body: ball, radius: RADIUS, position: [-0.1, 0.1, 0.3], rotation: [10 deg, 0, 0]}
    - SetStart: {start: $start}
    - Target: {start: $start, joints: {joint_1: -1.4, joint_2: -0.6, joint_3: -0.07}, goal: $goal}
    - PlanArm:
        start: $start
        goal: $goal
        via: [{joint_1: -0.4, joint_2: 0.2, joint_3: 0}, right]
        plan: $arm_plan
    - PlanGripper: {start: $start, goal: $goal, plan: $gripper_plan}
    - Execute: {arm_plan: $arm_plan, gripper_plan: $gripper_plan}
"""


def around(rig: RigMaker, folder: Path, radius: str = "1 cm") -> Rig:
    tasks = folder / "tasks"
    tasks.mkdir()
    (tasks / "7_around.yaml").write_text(AROUND.replace("RADIUS", radius))
    return rig(tasks)


def test_a_run_round_a_post_by_way_of_a_point(rig: RigMaker, tmp_path: Path) -> None:
    (outcome,) = around(rig, tmp_path).run(7)
    assert outcome.success, outcome.message
    path = Path(outcome.recording)
    arm = next(p for p in Recording(path).records(logs.Plan) if isinstance(p, logs.Plan))
    assert arm.via == ((-0.4, 0.2, 0.0), (-1.4, -0.6, -0.07))
    assert [body["name"] for body in arm.world] == ["post", "ball"]
    verification = verify(path)
    assert verification.holds, verification.text()
    for old, new in ((b"0.03,0.03,0.2", b"0.05,0.05,0.2"), (b"[[-0.4,0.2,", b"[[-0.5,0.2,")):
        verification = verify(altered(path, replace("Message", old, new)))
        assert checks(verification) == [True, False], verification.text()


def test_a_plan_that_a_body_forbids(rig: RigMaker, tmp_path: Path) -> None:
    (outcome,) = around(rig, tmp_path, "21 cm").run(7)
    assert outcome.code == "plan.start_in_collision"
    path = Path(outcome.recording)
    assert verify(path).holds
    verification = verify(altered(path, replace("Message", b'"radius":0.21', b'"radius":0.01')))
    assert checks(verification) == [True, False]
    why = "the run had plan.start_in_collision; planning again finds a motion"
    assert why in verification.text()


def test_a_canceled_plan_records_its_world(rig: RigMaker, tmp_path: Path) -> None:
    arm = around(rig, tmp_path)
    task = tmp_path / "tasks" / "7_around.yaml"  # back and forth, which takes long to plan
    task.write_text(task.read_text().replace("via: [", "via: [" + "upright, right, " * 30))
    arm.on_record = lambda record: (
        arm.cancel()
        if isinstance(record, logs.NodeStatus)
        and (record.name, record.status) == ("PlanArm", "RUNNING")
        else None
    )
    (outcome,) = arm.run(7)
    assert outcome.state.name == "CANCELED"
    (plan,) = arm.recorded(logs.Plan)
    assert plan.code == "plan.canceled"
    assert len(plan.world) == 2
    assert plan.via
    assert verify(Path(outcome.recording)).holds


def test_the_mesh_of_a_body_is_in_the_recording(rig: RigMaker, tmp_path: Path) -> None:
    mesh = tmp_path / "beam.stl"
    mesh.write_bytes((DATA / "beam.stl").read_bytes())
    made = around(rig, tmp_path)
    task = tmp_path / "tasks" / "7_around.yaml"
    post = f"    - AddMesh: {{body: beam, file: {mesh}, position: [0.25, 0.25, 0]}}\n    - AddBox:"
    task.write_text(task.read_text().replace("    - AddBox:", post))
    (outcome,) = made.run(7)
    assert outcome.success, outcome.message
    mesh.unlink()
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()
    (name,) = [name for name in Recording(verification.path).files if name.endswith("_beam.stl")]
    assert name in {body["mesh"]["path"] for body in made.recorded(logs.Plan)[0].world[:1]}
