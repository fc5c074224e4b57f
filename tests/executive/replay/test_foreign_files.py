"""A file that another program wrote ends every command with one line and a code."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from executive.goals.history import load_goal_history
from executive.goals.start_pose import last_command
from executive.replay.verification import verify
from hardware import load_robot
from logs.records.cdr import Message, decode, encode
from tests.executive.replay.test_verification import field
from tests.support.command_line.typed import typed
from tests.support.paths import EXAMPLES, ROBOT_FILE
from tests.support.recordings.alterations import Change, each, records_of, retold, rewritten
from tests.support.recordings.bombs import BOMBS

pytestmark = pytest.mark.slow

EXAMPLE = EXAMPLES / "recordings" / "7_measure.mcap"
DEEP, HUGE = "[" * 100_000, 10**4000
COMMANDS = [
    ("replay", "--watch", "--at", "9"),
    ("show",),
    ("log", "info"),
    ("log", "show", "--all"),
    ("log", "export"),
]
SLOW = [
    ("replay", "--verify"),
    ("replay", "--on", "virtual"),
    ("log", "plot", "-o", "plot.png"),
    ("log", "recover"),
]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a command exports is in a folder of the test."""
    monkeypatch.chdir(tmp_path)


def text(topic: str, new: str) -> Change:
    """Replaces the JSON of the first message of a topic."""

    def change(record: Any) -> None:
        record.data = encode("std_msgs/msg/String", Message(data=new))

    return each([topic], change, 1)


def note(name: str, **values: str | None) -> Change:
    """Replaces values of a note; None removes one."""

    def change(record: Any) -> None:
        if type(record).__name__ == "Metadata" and record.name == name:
            every = {**record.metadata, **values}
            record.metadata = {key: value for key, value in every.items() if value is not None}

    return change


def file(name: str, data: bytes) -> Change:
    """Replaces an attachment."""

    def change(record: Any) -> None:
        if type(record).__name__ == "Attachment" and record.name == name:
            record.data = data

    return change


def nested(depth: int) -> bytes:
    return b'{"sequence": ' * depth + b"{}" + b"}" * depth


CHANGES: dict[str, Change] = {
    "deep goal": text("/goal", DEEP),
    "deep timing": text("/serial/timing", DEEP),
    "deep plan": text("/plan/arm", '{"time":' * 5000),
    "huge limit": retold("/plan/arm", field("velocity_limits", 1, to=HUGE)),
    "huge time": retold("/plan/arm", field("times", 0, to=HUGE)),
    "huge duration": retold("/schedule", field("duration", to=HUGE)),
    "a node in itself": retold("/tree", field("path", to="")),
    "a node far down": retold("/tree", field("path", to="/".join("x" * 5000))),
    "firmware of a list": note("robot", firmware="[]"),
    "firmware of a number": note("robot", firmware="1"),
    "deep firmware": note("robot", firmware=DEEP),
    "no digest": note("robot", sha256=None),
    "no file": note("robot", file="nowhere"),
    "a huge epoch": note("armtree", epoch_ns="9" * 4000),
    "no epoch": note("armtree", epoch_ns="x"),
    "deep task": file("task.resolved.yaml", DEEP.encode()),
    "a task that is nearly too deep": file("task.resolved.yaml", nested(900)),
    "a task of a huge number": file(
        "task.resolved.yaml", json.dumps({"Target": {"joints": {"joint_1": 10**400}}}).encode()
    ),
    "deep robot file": file("arduinobot.toml", b"x = " + DEEP.encode()),
    "deep URDF": file("arduinobot.urdf", b"<robot>" + b"<a>" * 50_000),
}


def changed(path: Path, change: Change, example: Path = EXAMPLE) -> Path:
    """An example with a change, under the name of a run."""
    records = records_of(example)
    for record in records:
        change(record)
    return rewritten(path / "20260101T000000.000Z-7.mcap", records)


def ends(folder: Path, path: Path, *commands: tuple[str, ...]) -> None:
    """Each command ends with a status and words of its own."""
    for command in commands:
        status, out, err = typed(folder, *command, str(path))
        assert status in (0, 3, 10, 12), (command, status, out, err)
        assert "bug in armtree" not in err


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_file_ends_with_a_code(tmp_path: Path, name: str) -> None:
    path = changed(tmp_path, CHANGES[name])
    ends(tmp_path, path, *COMMANDS)
    verify(path)
    list(load_goal_history(tmp_path, 0.0))


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("arduinobot.toml", "name =", "name", "holds a robot that this version of armtree cannot"),
        ("arduinobot.toml", "baud =", "bauds =", "arduinobot.toml:"),
        ("arduinobot.urdf", "</robot>", "", "arduinobot.urdf:"),
        ("arduinobot.toml", "margin_m = 0.005", "margin_m = 1e9", "is unusable for planning"),
    ],
)
def test_the_error_of_a_recorded_robot_names_its_file_in_the_recording(
    tmp_path: Path, name: str, old: str, new: str, words: str
) -> None:
    """Not the temporary file that it was restored to, which is deleted afterwards."""
    text = (ROBOT_FILE.parent / name).read_text()
    assert old in text
    planned = EXAMPLE.with_name("3_wave.mcap")
    found = verify(changed(tmp_path, file(name, text.replace(old, new).encode()), planned))
    assert (found.code, found.holds) != ("", True)
    said = found.text() + found.json()
    assert words in said
    assert name in said
    assert "/armtree-" not in said


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_one_line_and_a_code(tmp_path: Path, name: str) -> None:
    path = tmp_path / "20260101T000000.000Z-1.mcap"
    path.write_bytes(BOMBS[name]())
    for command in COMMANDS:
        status, _, err = typed(tmp_path, *command, str(path))
        assert status in (0, 3, 10), (command, status, err)
        assert len(err.splitlines()) <= 1
    verify(path)
    assert list(load_goal_history(tmp_path, 0.0)) == []


def test_slow_commands_end_with_a_code(tmp_path: Path) -> None:
    ends(tmp_path, changed(tmp_path, CHANGES["deep timing"]), *SLOW)
    ends(tmp_path, changed(tmp_path, CHANGES["deep plan"]), *SLOW)


@pytest.mark.parametrize("value", [math.nan, math.inf, 9.0])
def test_a_pose_that_the_arm_cannot_have_is_not_offered(tmp_path: Path, value: float) -> None:
    def turn(record: Any) -> None:
        state = decode("sensor_msgs/msg/JointState", record.data)
        state.position = (value,) * len(state.position)
        record.data = encode("sensor_msgs/msg/JointState", state)

    robot = load_robot()
    assert last_command(robot, changed(tmp_path, lambda record: None).parent)
    changed(tmp_path, each(["/joint_states"], turn))
    assert last_command(robot, tmp_path) is None


def test_a_goal_whose_frames_cannot_be_read_is_in_the_history(tmp_path: Path) -> None:
    records, forget = records_of(EXAMPLE), text("/serial/timing", "[]")
    channels = {record.id: record.topic for record in records if type(record).__name__ == "Channel"}
    for record in records:
        forget(record)
    kept = [
        record
        for record in records
        if type(record).__name__ != "Message" or channels[record.channel_id] != "/result"
    ]
    rewritten(tmp_path / "20260101T000000.000Z-7.mcap", kept)
    ((_, _, outcome),) = load_goal_history(tmp_path, 0.0)
    assert (outcome.code, outcome.frames) == ("server.restarted", 0)
