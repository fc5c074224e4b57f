"""Whole runs: every reader gets the records that were written."""

import dataclasses
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

import logs
from logs import (
    Attachment,
    Feedback,
    Goal,
    LogLine,
    NodeStatus,
    Plan,
    Received,
    Record,
    Recorder,
    Result,
    Schedule,
    Sent,
    Summary,
    Transition,
)
from logs.views.narrative import narrative

EPOCH_NS = 1_795_000_000_000_000_000
GOAL_ID = "0123456789abcdef0123456789abcdef"
ARM = ("joint_1", "joint_2", "joint_3")
GRIPPER = ("joint_4", "joint_5")
ROOT = "Reach"
BOTH = f"{ROOT}/Plan both"
NODES = (
    ROOT,
    "SetStart",
    "CheckBounds",
    "Plan both",
    "PlanArm",
    "PlanGripper",
    "Execute",
    "Succeed",
)
# A schedule that was not planned.
MOTION: Any = ({"joint_1": 0.0}, 3.2, (), False, (), ())
PARENTS = {"PlanArm": BOTH, "PlanGripper": BOTH, "Plan both": ROOT}


def fail(cause: Exception) -> None:
    """Callback of recorders that must not fail."""
    raise AssertionError(cause)


def record(path: Path, records: list[Record]) -> Summary:
    """Records a list of records into one file."""
    recorder = Recorder(path, EPOCH_NS, fail)
    recorder.put(Attachment("task.yaml", "application/yaml", b"task: 1\n"))
    for item in records:
        recorder.put(item)
    return recorder.close()


def node(time: float, name: str, status: str, message: str = "") -> NodeStatus:
    """A node's status change; the path follows from the name."""
    path = ROOT if name == ROOT else f"{PARENTS.get(name, ROOT)}/{name}"
    return NodeStatus(time, path, name, status, message)


def lifecycle(time: float) -> list[Record]:
    """Transitions from unconfigured to active; the board boots for 0.6 s."""
    ok = "transition_success"
    return [
        Transition(time, "configure", "unconfigured", "configuring"),
        Transition(time + 0.01, ok, "configuring", "inactive"),
        Transition(time + 0.02, "activate", "inactive", "activating"),
        Received(time + 0.5, b"\x00\xffarduino ready\r\n"),
        Transition(time + 0.62, ok, "activating", "active"),
    ]


def plan(time: float, group: str, joints: tuple[str, ...], goal: tuple[float, ...]) -> Plan:
    """A straight motion from zero with smooth ends, 33 samples at 10 Hz."""
    steps = 33
    share = [(1 - math.cos(math.pi * i / (steps - 1))) / 2 for i in range(steps)]
    return Plan(
        time=time,
        group=group,
        joints=joints,
        start=dict.fromkeys(("joint_1", "joint_2", "joint_3", "joint_4"), 0.0),
        goal=goal,
        via=(),
        world=(),
        seed=1,
        velocity_limits=(1.0,) * len(goal),
        acceleration_limits=(0.5,) * len(goal),
        waypoints=((0.0,) * len(goal), goal),
        times=tuple(i / 10 for i in range(steps)),
        positions=tuple(tuple(s * value for value in goal) for s in share),
        duration=(steps - 1) / 10,
        milliseconds={"straight": 3.2},
        code="",
        message="",
    )


def frame(joints: tuple[float, ...]) -> bytes:
    """A frame similar to the published wire format."""
    b, s, e, g = (int(math.degrees(value)) + 90 for value in joints[:4])
    return f"b{b:03d},s{s:03d},e{e:03d},g{90 - g:03d},".encode()


def pick_run(frames: int | None = None, begin: float = 40.0) -> list[Record]:
    """A successful run of task 1; with `frames`, canceled after that many frames."""
    t = begin
    arm = plan(t + 0.72, "arm", ARM, (-1.4, -0.6, -0.07))
    gripper = plan(t + 0.68, "gripper", GRIPPER, (-0.7, 0.7))
    motion: list[Record] = []
    for i in range(len(arm.times)):
        joints = (*arm.positions[i], *gripper.positions[i])
        due = t + 0.8 + arm.times[i]
        motion.append(Sent(due + 0.0002, frame(joints), due, False, ARM + GRIPPER, joints))
        share = 100 * (i + 1) // 33
        motion.append(Feedback(due + 0.0003, GOAL_ID, share, "executing", "Execute"))
    texts = tuple(item.data.decode() for item in motion if isinstance(item, Sent))
    head: list[Record] = [
        Goal(t, GOAL_ID, 1, "pick", 1),
        LogLine(t, 20, "executive.goals.run_loop", "goal accepted"),
        *lifecycle(t + 0.01),
        *(node(t + 0.63, name, "INVALID") for name in NODES),
        node(t + 0.64, "SetStart", "SUCCESS", "at zero"),
        node(t + 0.64, "CheckBounds", "SUCCESS"),
        node(t + 0.6401, "PlanArm", "RUNNING"),
        node(t + 0.6402, "PlanGripper", "RUNNING"),
        node(t + 0.6403, "Plan both", "RUNNING"),
        node(t + 0.6404, ROOT, "RUNNING"),
        gripper,
        node(t + 0.68, "PlanGripper", "SUCCESS"),
        arm,
        node(t + 0.7201, "PlanArm", "SUCCESS", "straight"),
        node(t + 0.7202, "Plan both", "SUCCESS"),
        Schedule(t + 0.75, 10.0, "stock", arm.times, texts, (0.0,) * len(texts), 0.0, *MOTION),
        node(t + 0.7503, "Execute", "RUNNING"),
    ]
    return head + (_cut(motion, frames) if frames else _through(motion, begin))


def _through(motion: list[Record], begin: float) -> list[Record]:
    end = begin + 4.3
    result = Result(end, GOAL_ID, 1, "SUCCEEDED", True, "", "Task 1 done", 33, 4.3)
    last = [node(end - 0.001, name, "SUCCESS") for name in ("Execute", "Succeed", ROOT)]
    return [*motion, *last, result]


def _cut(motion: list[Record], frames: int) -> list[Record]:
    kept = motion[: 2 * frames]
    sent = kept[-2]
    assert isinstance(sent, Sent)
    t = sent.time + 0.06
    return [
        *kept,
        Feedback(t, GOAL_ID, 45, "canceling", "Execute"),
        node(t + 0.0001, "Execute", "INVALID"),
        node(t + 0.0002, ROOT, "INVALID"),
        Sent(t + 0.0004, sent.data, None, True, sent.joints, sent.positions),
        Result(t + 0.11, GOAL_ID, 1, "CANCELED", False, "goal.canceled", "Canceled", frames, 2.5),
    ]


def refused_run() -> list[Record]:
    """A run that is refused: its target is out of bounds."""
    message = "Target position out of boundaries: joint_1 2 rad is above 1.57 rad"
    return [
        Goal(7.0, GOAL_ID, 9, "far", 1),
        LogLine(7.0, 40, "executive.goals.run_loop", message),
        node(7.001, "SetStart", "SUCCESS"),
        node(7.0011, "CheckBounds", "FAILURE", message),
        node(7.0012, ROOT, "FAILURE", message),
        Result(7.002, GOAL_ID, 9, "ABORTED", False, "goal.bounds", message, 0, 0.002),
    ]


def faulted_run() -> list[Record]:
    """A run whose cable is pulled after ten frames."""
    moved = pick_run(frames=10)[:-5]
    t = moved[-1].time + 0.05
    words = "the port is gone"
    return [
        *moved,
        Transition(t, "raise_error", "active", "errorprocessing"),
        LogLine(t, 40, "hardware", words),
        Transition(t + 0.01, "transition_success", "errorprocessing", "unconfigured"),
        Result(t + 0.02, GOAL_ID, 1, "ABORTED", False, "hardware.port_gone", words, 10, 2.0),
    ]


RUNS = {
    "ok": pick_run(),
    "canceled": pick_run(frames=15),
    "faulted": faulted_run(),
    "refused": refused_run(),
}


def rebuilt(messages: list[logs.Message]) -> list[Record]:
    """The records of a recording."""
    by_topic: dict[str, list[logs.Message]] = {}
    for message in messages:
        by_topic.setdefault(message.topic, []).append(message)
    records: list[Record] = []
    for topic, found in by_topic.items():
        if topic == "/serial/tx":
            joints = iter(by_topic.get("/joint_states", ()))
            timing = by_topic["/serial/timing"]
            records += [sent(*both, joints) for both in zip(found, timing, strict=True)]
        elif topic in JSON_RECORDS or (topic.startswith("/plan/") and topic.count("/") == 2):
            kind = JSON_RECORDS.get(topic, Plan)
            records += [kind(**tuples(message.fields())) for message in found]
        elif topic in PLAIN_RECORDS:
            records += [PLAIN_RECORDS[topic](seconds(message), message.data) for message in found]
    return sorted(records, key=order)


def order(record: Record) -> tuple[float, str]:
    """Files keep the order of writing; two topics of a file are ordered by time only."""
    return record.time, repr(record)


def seconds(message: logs.Message) -> float:
    return (message.time_ns - EPOCH_NS) / 1e9


def tuples(fields: dict[str, Any]) -> dict[str, Any]:
    """JSON has lists only."""
    return {key: as_tuple(value) for key, value in fields.items()}


def as_tuple(value: Any) -> Any:
    return tuple(map(as_tuple, value)) if isinstance(value, list) else value


def sent(frame: logs.Message, timing: logs.Message, joints: Iterator[logs.Message]) -> Sent:
    facts = timing.fields()
    assert frame.data.seq == facts["seq"]
    assert frame.time_ns == timing.time_ns
    assert frame.data.direction == 0
    moved: tuple[tuple[str, ...], tuple[float, ...]] = (), ()
    if not facts["setting"]:
        message = next(joints)
        assert message.time_ns == frame.time_ns
        moved = tuple(message.data.name), message.data.position
    return Sent(facts["time"], bytes(frame.data.data), facts["scheduled"], facts["hold"], *moved)


JSON_RECORDS: dict[str, type[Any]] = {
    "/goal": Goal,
    "/result": Result,
    "/progress": Feedback,
    "/tree": NodeStatus,
    "/schedule": Schedule,
}
PLAIN_RECORDS: dict[str, Any] = {
    "/serial/rx": lambda time, data: Received(time, bytes(data.data)),
    "/rosout": lambda time, data: LogLine(time, data.level, data.name, data.msg),
    "/lifecycle": lambda time, data: Transition(
        time, data.transition.label, data.start_state.label, data.goal_state.label
    ),
}


def exact(record: Record) -> Record:
    """A record as it is read: its time in whole nanoseconds if only the stamp holds it."""
    if isinstance(record, Received | LogLine | Transition):
        return dataclasses.replace(record, time=round(record.time, 9))
    return record


@pytest.mark.parametrize("name", RUNS)
def test_every_record_comes_back_as_it_was(tmp_path: Path, name: str) -> None:
    path = tmp_path / "run.mcap"
    summary = record(path, RUNS[name])
    messages = list(logs.read(path))
    assert rebuilt(messages) == sorted(map(exact, RUNS[name]), key=order)
    assert summary == Summary(path, len(messages), path.stat().st_size, True, 0)


def test_the_stock_reader_reads_all_and_finds_every_checksum_right(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = Counter(channel.topic for _, channel, _ in reader.iter_messages())
        attachments = [(item.name, item.data) for item in reader.iter_attachments()]
        facts = {item.name: item.metadata for item in reader.iter_metadata()}
        assert reader.get_header().profile == "ros2"
    assert found["/serial/tx"] == found["/joint_states"] == found["/feedback"] == 33
    assert found["/plan/arm"] == found["/plan/arm/trajectory"] == found["/plan/gripper"] == 1
    assert sum(found.values()) == summary.statistics.message_count
    assert attachments == [("task.yaml", b"task: 1\n")]
    assert facts.keys() == {"armtree", "rosbag2", "digests"}
    assert facts["armtree"] == {"epoch_ns": str(EPOCH_NS)}
    notes = {"note armtree", "note rosbag2"}
    assert facts["digests"].keys() == {*found, *notes, "file task.yaml"}
    assert all(index.compression == "zstd" for index in summary.chunk_indexes)


def test_rosbags_reads_all_with_the_types_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    summary = record(path, RUNS["ok"])
    with AnyReader([path]) as reader:
        found = [
            (connection.topic, reader.deserialize(data, connection.msgtype))
            for connection, _, data in reader.messages()
        ]
    assert len(found) == summary.messages
    frames = [item.text for topic, item in found if topic == "/serial/tx"]  # type: ignore[attr-defined]
    assert frames[0] == "b090,s090,e090,g000,"
    assert frames == [item.data.decode() for item in RUNS["ok"] if isinstance(item, Sent)]


def test_the_trajectory_is_the_sampled_motion(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    (message,) = logs.read(path, ["/plan/arm/trajectory"])
    (wanted,) = (item for item in RUNS["ok"] if isinstance(item, Plan) and item.group == "arm")
    points = message.data.points
    assert message.data.joint_names == list(ARM)
    assert [point.positions for point in points] == list(wanted.positions)
    times = [point.time_from_start.sec + point.time_from_start.nanosec / 1e9 for point in points]
    assert times == pytest.approx(list(wanted.times), abs=1e-9)


def test_a_plan_that_failed_has_no_trajectory(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    found = plan(1.0, "arm", ARM, (1.0, 0.0, 0.0))
    failed = dataclasses.replace(found, times=(), positions=(), code="plan.collision")
    record(path, [failed])
    (message,) = logs.read(path)
    assert message.topic == "/plan/arm"
    assert message.fields()["code"] == "plan.collision"


def test_feedback_is_that_of_the_action(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, [Feedback(1.0, GOAL_ID, 42, "executing", "Execute")])
    (message,) = logs.read(path, ["/feedback"])
    assert bytes(message.data.goal_id.uuid).hex() == GOAL_ID
    assert message.data.percentage == 42


def test_received_bytes_of_any_kind_have_a_text(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, [Received(1.0, bytes(range(256)))])
    (message,) = logs.read(path)
    assert bytes(message.data.data) == bytes(range(256))
    assert "\0" not in message.data.text
    assert message.data.text.startswith("0x00 01 02 ")


def test_a_setting_of_the_board_moves_no_joint(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    moved = [item for item in RUNS["ok"] if isinstance(item, Sent)]
    reported: list[Record] = [Sent(1.0, b"bA01;", None, False, (), ()), *moved]
    record(path, reported)
    assert list(logs.Recording(path).records()) == reported
    assert len(logs.table(path, "/joint_states")["joint_1"]) == len(moved)


def test_the_narrative_mentions_a_hold(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["canceled"])
    reported = [words for _, words in narrative(path, everything=False)]
    assert len([words for words in reported if words.startswith("hold: ")]) == 1
    assert not [words for words in reported if words.startswith("sent: ")]
