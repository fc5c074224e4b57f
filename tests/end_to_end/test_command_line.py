"""The command line as a user runs it: real pseudo-terminals, real recordings, processes.

What needs no process of its own is typed in this one.
"""

import json
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import threading
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.support.arms.quick_arm import quick_arm
from tests.support.command_line.typed import typed
from tests.support.paths import EXAMPLES

pytestmark = pytest.mark.slow

ARMTREE = [sys.executable, "-P", "-m", "armtree"]


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return quick_arm(tmp_path)


def start(folder: Path, *arguments: str) -> "subprocess.Popen[str]":
    """An armtree process that records into a folder."""
    return subprocess.Popen(
        [*ARMTREE, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "ARMTREE_RECORDINGS": str(folder)},
    )


def finish(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of an armtree process."""
    with start(folder, *arguments) as process:
        out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def events(out: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in out.splitlines()]


def sent_frames(recording: Path) -> list[str]:
    """The frames in a recording, read by the stock reader with its CRCs checked."""
    store = get_typestore(Stores.ROS2_JAZZY)
    frames = []
    with recording.open("rb") as stream:
        for schema, _, message in make_reader(stream, validate_crcs=True).iter_messages(
            topics=["/serial/tx"]
        ):
            assert schema
            if "arduinobot_msgs/msg/SerialFrame" not in store.types:
                text = schema.data.decode()
                store.register(get_types_from_msg(text, "arduinobot_msgs/msg/SerialFrame"))
            decoded: Any = store.deserialize_cdr(message.data, "arduinobot_msgs/msg/SerialFrame")
            frames.append(bytes(decoded.data).decode())
    return frames


class Listener:
    """A foreign board: a program on a pseudo-terminal that only listens."""

    def __init__(self) -> None:
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave
        self.heard = b""
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self.heard.endswith(b"END"):
            self.heard += os.read(self.master, 4096)

    def close(self) -> None:
        self.frames()
        os.close(self._slave)
        os.close(self.master)

    def frames(self) -> list[str]:
        """Stop listening; return the received frames."""
        if self._thread.is_alive():
            os.write(self._slave, b"END")
            self._thread.join()
        text = self.heard.removesuffix(b"END").decode()
        return [text[i : i + 20] for i in range(0, len(text), 20)]


@pytest.fixture
def listener() -> Iterator[Listener]:
    listener = Listener()
    yield listener
    listener.close()


def test_tasks_run_and_leave_recordings(tmp_path: Path, robot: Path) -> None:
    status, out, err = finish(tmp_path, "run", "0", "1", "2", "--robot", str(robot), "--json")
    assert (status, err) == (0, "")
    reported = events(out)
    results = [event for event in reported if event["event"] == "result"]
    assert reported[-1] is results[-1]
    assert [r["task"] for r in results] == [0, 1, 2]
    assert {r["state"] for r in results} == {"SUCCEEDED"}
    assert all(r["success"] and r["code"] == "ok" for r in results)
    last = ["b090,s090,e090,g080,", "b009,s125,e085,g000,", "b000,s090,e038,g000,"]
    frames = [sent_frames(Path(r["recording"])) for r in results]
    assert [lines[-1] for lines in frames] == last
    assert [len(lines) for lines in frames] == [r["frames"] for r in results]
    goals = [event["goal_id"] for event in reported if event["event"] == "goal"]
    assert len(goals) == 3
    feedback = [event for event in reported if event["event"] == "feedback"]
    for goal in goals:
        rises = [event["percentage"] for event in feedback if event["goal_id"] == goal]
        shown = [percentage for percentage in rises if percentage is not None]
        assert rises[0] is None  # while it plans
        assert shown == sorted(shown)
        assert shown[-1] == 100
        assert 100 not in shown[:-1]


def test_another_program_on_a_pty_hears_the_same_frames(
    tmp_path: Path, robot: Path, listener: Listener
) -> None:
    arguments = ["run", "1", "--robot", str(robot), "--json", "--port", listener.port]
    status, out, _ = finish(tmp_path, *arguments)
    assert status == 0
    assert listener.frames() == sent_frames(Path(events(out)[-1]["recording"]))
    assert listener.frames()[-1] == "b009,s125,e085,g000,"


def test_plain_text_names_the_port_first_and_the_outcome_last(tmp_path: Path, robot: Path) -> None:
    status, out, err = typed(tmp_path, "run", "0", "--robot", str(robot))
    lines = out.splitlines()
    assert (status, err) == (0, "")
    assert lines[0].startswith("Port virtual")
    assert "task 0 SUCCEEDED" in lines[-2]
    assert lines[-1].strip().startswith("recording ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_a_move_sends_the_hold_frame_and_no_other(
    tmp_path: Path, robot: Path, number: signal.Signals
) -> None:
    slow = "move", "joint_1=80deg", "--speed", "0.2", "--port", "virtual"
    with start(tmp_path, *slow, "--robot", str(robot), "--json") as process:
        assert process.stdout
        reported = []
        for line in process.stdout:
            reported.append(json.loads(line))
            moved = sum(event["event"] == "sent" for event in reported)
            if moved == 4 and reported[-1]["event"] == "sent":
                process.send_signal(number)
    result = reported[-1]
    assert process.returncode == 7
    assert (result["state"], result["code"], result["success"]) == (
        "CANCELED",
        "goal.canceled",
        False,
    )
    frames = sent_frames(Path(result["recording"]))
    holds = [event["hold"] for event in reported if event["event"] == "sent"]
    assert frames[-1] == frames[-2]
    assert holds.count(True) == 1
    assert holds[-1]


def test_the_end_of_the_shell_changes_nothing_where_nohup_says_so(
    tmp_path: Path, robot: Path
) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup sets it for its program
    try:
        process = start(tmp_path, "run", "0", "--robot", str(robot), "--json")
    finally:
        signal.signal(signal.SIGHUP, before)
    with process:
        assert process.stdout
        reported = []
        for line in process.stdout:
            reported.append(json.loads(line))
            if reported[-1]["event"] == "sent":
                process.send_signal(signal.SIGHUP)
    assert (process.returncode, reported[-1]["state"]) == (0, "SUCCEEDED")


def test_ctrl_c_while_the_board_boots_sends_nothing(tmp_path: Path, robot: Path) -> None:
    robot.write_text(robot.read_text().replace("boot_wait_s = 1.05", "boot_wait_s = 20.0"))
    with start(tmp_path, "run", "1", "--robot", str(robot), "--json") as process:
        assert process.stdout
        reported = []
        for line in process.stdout:
            reported.append(json.loads(line))
            if reported[-1].get("label") == "activate":
                process.send_signal(signal.SIGINT)
    assert process.returncode == 7
    assert reported[-1]["state"] == "CANCELED"
    assert sent_frames(Path(reported[-1]["recording"])) == []


def test_a_reader_that_goes_away_leaves_the_goal_running(tmp_path: Path, robot: Path) -> None:
    with start(tmp_path, "run", "0", "--robot", str(robot)) as process:
        assert process.stdout
        assert process.stdout.readline().startswith("Port")
        process.stdout.close()
        process.wait(timeout=30)
    (recording,) = tmp_path.glob("*-0.mcap")
    assert process.returncode == 0
    assert sent_frames(recording)[-1] == "b090,s090,e090,g080,"


def write_task(folder: Path, number: int, arm: str, gripper: str) -> None:
    text = f"task: {number}\nname: test\ndescription: A test.\ntree:\n  subtree: reach\n"
    text += f"  with:\n    arm: {arm}\n    gripper: {gripper}\n"
    (folder / f"{number}_test.yaml").write_text(text)


BAD = [
    (["run", "9"], 4, "Invalid task number 9; there are 0, 1, 2"),
    (["run", "0", "9"], 4, "Invalid task number 9"),
    (["run", "1", "--port", ""], 3, "No serial port provided"),
    (["run", "1", "--port", "/dev/ttyNOPE"], 6, "There is no serial port /dev/ttyNOPE"),
    (["run", "1", "--robot", "nope.toml"], 3, "nope.toml: there is no such file"),
    (["run", "1", "--trees", "nope"], 3, "nope: there is no such folder"),
    (["run", "1", "--recordings", "/dev/null/x"], 10, "cannot be created"),
]


@pytest.mark.parametrize(("arguments", "exit_status", "words"), BAD)
def test_bad_input_is_reported_and_nothing_moves(
    tmp_path: Path, arguments: list[str], exit_status: int, words: str
) -> None:
    status, out, err = typed(tmp_path, *arguments, "--json")
    result = events(out)[-1]
    assert (status, err) == (exit_status, "")
    assert result["state"] == "ABORTED"
    assert result["success"] is False
    assert words in result["message"]
    assert result["frames"] == 0
    assert not [event for event in events(out) if event.get("goal") == "active"]


@pytest.mark.parametrize(
    "arguments", [["run"], ["run", "1", "--x"], ["fly"], ["run", "1", "--seed", "0"]]
)
def test_wrong_usage_is_2(tmp_path: Path, arguments: list[str]) -> None:
    status, out, err = typed(tmp_path, *arguments)
    assert (status, out) == (2, "")
    assert re.fullmatch(r"Error: .+; see armtree .*--help \[usage\]\n", err)


def test_a_target_out_of_bounds_names_every_joint(tmp_path: Path) -> None:
    arm, gripper = "{joint_1: 2, joint_2: 0, joint_3: -9.5}", "{joint_4: 0.5, joint_5: -0.5}"
    write_task(tmp_path, 6, arm, gripper)
    status, out, _ = typed(tmp_path, "run", "6", "--trees", str(tmp_path), "--json")
    message = events(out)[-1]["message"]
    assert status == 4
    assert message.startswith("Target position out of boundaries")
    for part in (
        "joint_1 = 114.59 deg",
        "joint_3 = -544.31 deg",
        "joint_4 = 28.648 deg",
        "joint_5 = -28.648 deg",
        "-90 deg to 90 deg",
    ):
        assert part in message
    assert "joint_2" not in message


def test_a_wrong_task_file_is_reported_with_its_line(tmp_path: Path) -> None:
    write_task(tmp_path, 7, "{joint_1: 0, joint_2: 0, joint_3: zero}", "{joint_4: 0}")
    status, out, _ = typed(tmp_path, "run", "7", "--trees", str(tmp_path), "--json")
    assert status == 3
    assert f"{tmp_path}/7_test.yaml:7:44" in events(out)[-1]["message"]


def test_a_goal_in_collision_fails_in_planning(tmp_path: Path, robot: Path) -> None:
    write_task(tmp_path, 8, "{joint_1: 0, joint_2: -1.5, joint_3: -1.2}", "{joint_4: 0}")
    arguments = ["run", "8", "--trees", str(tmp_path), "--robot", str(robot), "--json"]
    status, out, _ = typed(tmp_path, *arguments)
    result = events(out)[-1]
    assert status == 5
    assert result["code"] == "plan.goal_in_collision"
    assert result["message"].startswith("One or more planners failed: PlanArm, PlanGripper: ")
    assert result["frames"] == 0


def test_a_busy_port_is_9(tmp_path: Path, robot: Path, listener: Listener) -> None:
    arguments = ["--robot", str(robot), "--json", "--port", listener.port]
    with start(tmp_path, "run", "1", "0", *arguments) as first:  # two tasks take long enough
        assert first.stdout
        for line in first.stdout:
            if json.loads(line)["event"] == "sent":
                break
        status, out, _ = typed(tmp_path, "run", "1", *arguments)
        rest = first.stdout.read()
    assert status == 9
    assert str(first.pid) in events(out)[-1]["message"]
    assert events(rest)[-1]["state"] == "SUCCEEDED"


def test_a_run_on_the_arm_of_a_server_offers_to_send(
    tmp_path: Path, robot: Path, listener: Listener
) -> None:
    arguments = ["--robot", str(robot), "--port", listener.port, "--trees", str(EXAMPLES)]
    with start(tmp_path, "serve", "--activate", "--tcp-port", "0", *arguments) as server:
        assert server.stderr
        lines = iter(server.stderr.readline, "")
        url = next(words[0] for line in lines if (words := re.findall(r"http://[\d.:]+", line)))
        assert any("is ready to take commands" in line for line in lines)
        (mine := tmp_path / "mine").mkdir()
        write_task(mine, 3, "{joint_1: 0, joint_2: 0, joint_3: 0}", "{joint_4: 0}")
        other = typed(tmp_path, "run", "3", *arguments[:-1], str(mine))[1]
        assert "an armtree server has the arm, but not this task" in " ".join(other.split())
        status, out, _ = typed(tmp_path, "run", "3", "--set", "swing=5 deg", *arguments)
        server.send_signal(signal.SIGINT)
        server.stderr.read()
    assert status == 9
    offered = f"armtree send 3 --wait --set 'swing=5 deg' --server {url}\n"
    assert f"  -> an armtree server has the arm; give {offered}" in out


def test_tasks_are_listed(tmp_path: Path) -> None:
    write_task(tmp_path, 12, "{}", "{}")
    status, out, err = typed(tmp_path, "tasks", "--trees", str(tmp_path))
    assert (status, err) == (0, "")
    lines = [line.split()[:2] for line in out.splitlines()]
    tasks, sources = lines[::2], lines[1::2]
    assert tasks == [["0", "home"], ["1", "pick"], ["2", "rest"], ["12", "test"]]
    assert sources == [["shipped"]] * 3 + [[str(tmp_path / "12_test.yaml")]]


def test_a_recording_is_drawn(tmp_path: Path) -> None:
    recording = shutil.copy(EXAMPLES / "recordings" / "3_wave.mcap", tmp_path)
    status, out, err = typed(tmp_path, "log", "plot", str(recording))
    assert (status, err) == (0, "")
    assert Path(out.strip()).read_bytes().startswith(b"\x89PNG")
    assert typed(tmp_path, "log", "plot", str(tmp_path / "nope.mcap"))[0] == 3


def test_doctor_looks_and_opens_nothing(tmp_path: Path, listener: Listener) -> None:
    status, out, err = typed(tmp_path, "doctor", "--port", listener.port)
    assert (status, err) == (0, "")
    assert "NO" not in out
    assert out.splitlines()[-1] == f"Next, type: armtree run 0 --port {listener.port}"
    assert listener.frames() == []


@pytest.mark.parametrize("module", ["click", "ruamel"])
def test_ctrl_c_while_it_loads(tmp_path: Path, module: str) -> None:
    (tmp_path / f"{module}.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)")
    done = subprocess.run(
        [*ARMTREE, "run", "1"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr.strip()) == (130, "", "")
