"""`armtree serve` and its clients, as processes."""

import io
import json
import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from armtree import Client
from executive.api.events import Where
from executive.api.outcome import GoalState
from executive.cli.support import server_goals
from executive.cli.support.log_handler import LogHandler
from executive.cli.support.server_requests import status_lines
from executive.cli.terminal.live.live_view import LiveView
from hardware import State
from logs import LogLine, Recording
from tests.logs.writing.test_compaction import run_journal
from tests.support.paths import ROBOT_FILE
from tests.support.servers.serving import TASKS, Served, Typed

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

ARMTREE = [sys.executable, "-P", "-m", "armtree"]


class Shell:
    """A working directory for commands, and the server that runs there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.tasks = folder / "tasks"
        self.tasks.mkdir()
        for name, text in TASKS.items():
            (self.tasks / name).write_text(text)
        text = ROBOT_FILE.read_text()
        urdf = ROBOT_FILE.with_suffix(".urdf")
        text = text.replace('"arduinobot.urdf"', json.dumps(str(urdf)))
        self.robot = folder / "quick.toml"
        self.robot.write_text(re.sub(r"boot_wait_s = .*", "boot_wait_s = 1.0", text))
        self.environment = {
            **{k: v for k, v in os.environ.items() if not k.startswith("ARMTREE")},
            "XDG_RUNTIME_DIR": str(folder),
        }
        self.log: list[str] = []

    def serve(self, *options: str) -> None:
        """Start a server, and wait for the state of its arm."""
        command = [*ARMTREE, "serve", "--port", "virtual", "--tcp-port", "0", "--trees", "tasks"]
        command += ["--robot", str(self.robot), *options]
        self.server = self.begin(command)
        self.read("Listening on")
        port = re.search(r":(\d+);", self.log[-1])
        assert port
        self.environment["ARMTREE_TCP_PORT"] = port[1]
        self.read("ready to take commands" if "--activate" in options else "not active")

    def begin(self, command: list[str]) -> subprocess.Popen[str]:
        """Start a process."""
        return subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def read(self, words: str) -> str:
        """Read the server's log until a line contains a text."""
        assert self.server.stderr
        for line in self.server.stderr:
            self.log.append(line)
            if words in line:
                return line
        raise AssertionError(f"{words!r} is not in {self.log}")

    def type(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run a command."""
        return subprocess.run(
            [*ARMTREE, *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )

    def end(self, number: signal.Signals) -> int:
        """Send the server a signal; return its exit status."""
        self.server.send_signal(number)
        _, rest = self.server.communicate(timeout=30)
        self.log += rest.splitlines(keepends=True)
        return self.server.returncode


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Shell]:
    made = Shell(tmp_path)
    yield made
    if hasattr(made, "server") and made.server.poll() is None:
        assert made.end(signal.SIGTERM) == 0


def test_a_day_in_the_life_of_a_server(typed: tuple[Served, Typed]) -> None:
    _, type_in = typed
    assert "Arm       inactive, port board" in type_in("status")[1]
    assert type_in("send", "1", "--wait")[0] == 6
    assert type_in("arm", "activate")[1] == "active\n"
    assert "Commanded joint_1 0.0 deg, " in type_in("status")[1]
    assert re.search("^Tool      .* mm$", type_in("status")[1], re.M)
    assert type_in("arm", "activate")[0] == 6
    status, out, error = type_in("send", "1", "--wait")
    assert (status, error) == (0, "")
    assert re.search(r"Execute +success +\d+ of \d+ frames", out)
    assert "task 1 SUCCEEDED" in out
    reported = type_in("send", "11", "--json", "--wait")[1]
    events = [json.loads(line) for line in reported.splitlines()]
    assert events[-1]["event"] == "result"
    assert {"goal", "node", "feedback"} <= {event["event"] for event in events}


@pytest.mark.parametrize("json_option", [(), ("--json",)])
def test_a_stop_overtakes_an_activation(
    typed: tuple[Served, Typed], monkeypatch: pytest.MonkeyPatch, json_option: tuple[str, ...]
) -> None:
    served, type_in = typed
    activate = Client.arm

    def delayed(client: Client, *arguments: Any) -> str:
        served.executive.cancel()
        return activate(client, *arguments)

    monkeypatch.setattr(Client, "arm", delayed)
    status, _, error = type_in("arm", "activate", *json_option)
    assert (status, "[goal.sent_before_stop]" in error) == (4, True)
    assert "Arm       inactive" in type_in("status")[1]


def test_a_live_view_of_a_server_knows_its_boot_and_its_joints(
    typed: tuple[Served, Typed], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, type_in = typed
    console = Console(file=io.StringIO(), width=80, height=24, force_terminal=True, no_color=True)
    monkeypatch.setattr(server_goals, "view_for", lambda *_: LiveView(console))
    screen = console.file
    assert isinstance(screen, io.StringIO)
    assert type_in("arm", "activate")[:2] == (0, "active\n")
    assert type_in("send", "1", "--wait")[0] == 0
    *_, last = re.sub("\x1b[^mhlJHK]*[mhlJHK]", "", screen.getvalue()).split("task 1 nothing ")
    assert re.search("^joint_1 +-?[0-9.]+ deg ├.*●.*┤$", last, re.M)


def test_the_state_of_a_server_has_the_measured_position(typed: tuple[Served, Typed]) -> None:
    status, at = typed[0].executive.status(), {"joint_1": 0.5}
    where = Where(State.ACTIVE, {"joint_1": "rad"}, commanded=at, measured={"joint_1": 0.6})
    lines = [*status_lines(status, where)]
    assert lines[1:3] == ["Commanded joint_1 28.6 deg", "Measured  joint_1 34.4 deg"]
    lines = [*status_lines(status, replace(where, measured=None))]
    assert not any("Measured" in line for line in lines)


def test_a_task_by_its_name(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    assert type_in("send", "nothing", "--wait")[0] == 0
    last = type_in("send", "say", "--set", "often=9", "--json", "--wait")[1].splitlines()[-1]
    assert json.loads(last).items() >= {"event": "result", "task": 12, "success": False}.items()
    status, out, error = type_in("send", "nothin", "--json", "--wait")
    assert (status, json.loads(out)["code"]) == (4, "goal.unknown_task")
    assert "did you mean nothing?" in error
    assert type_in("send", "-1")[0] == type_in("send", "9" * 5000)[0] == 2


def until_executing(served: Served, goal: str) -> None:
    """Wait until a goal is executed; before, it cannot be paused."""
    while served.executive.goal(goal).state is not GoalState.EXECUTING:
        continue


def test_in_json_too(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed

    def reported(*words: str) -> dict[str, Any]:
        (line,) = type_in(*words, "--json")[1].splitlines()
        answer: dict[str, Any] = json.loads(line)
        return answer

    assert reported("arm", "activate") == {"arm": "active"}
    assert reported("arm", "activate")["code"] == "hw.transition_refused"
    assert reported("step")["code"] == "goal.not_executing"
    assert reported("break") == {"breakpoints": []}
    assert reported("break", "pick") == {"breakpoints": ["pick"]}
    assert reported("answer") == {"questions": []}
    goal = reported("send", "10")["goal_id"]
    until_executing(served, goal)
    assert reported("pause")["goal_id"] == reported("resume", goal)["goal_id"] == goal


def test_pausing_and_canceling(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    assert type_in("pause")[0] == 4
    goal = type_in("send", "10")[1].strip()
    assert re.fullmatch("[0-9a-f]{32}", goal)
    assert json.loads(type_in("status", "--json")[1])["goal"]["goal_id"] == goal
    assert type_in("send", "11")[0] == 4
    until_executing(served, goal)
    assert type_in("pause")[0] == 0
    assert re.findall(" paused| PAUSED", type_in("status")[1]) == [" PAUSED"]
    assert type_in("resume", goal)[0] == 0
    assert type_in("step")[0] == 4
    assert type_in("cancel", goal)[1] == f"canceling {goal}\n"
    assert type_in("cancel", goal)[0] == 4
    assert type_in("cancel")[1] == "there is nothing to cancel\n"
    served.executive.result(goal)
    goal = type_in("send", "10")[1].strip()
    stamp = json.loads(type_in("status", "--json")[1])["goal"]["stamp_ns"]
    assert type_in("cancel", "--until", str(stamp - 1))[1] == "there is nothing to cancel\n"
    assert type_in("cancel", "--until", str(stamp))[1] == f"canceling {goal}\n"
    assert json.loads(type_in("cancel", "--json")[1]) == {"return_code": 0, "goals": []}


def test_breakpoints(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    assert type_in("break") == (0, "no breakpoints\n", "")
    for wrong, words in [
        ("pick/Exceute", "no node pick/Exceute; there are pick, pick/SetStart, "),
        ("pick/Exceute", "; did you mean pick/Execute?"),
        ("pic/Execute", "no task is called pic; did you mean pick?"),
        ("Execute", "no task is called Execute; a path begins with a task: home, pick, "),
    ]:
        status, _, error = type_in("break", wrong)
        assert (status, words in error) == (4, True), error
    assert type_in("break", "pick/parallel/PlanArm") == (0, "pick/parallel/PlanArm\n", "")
    assert type_in("break", "pick/Execute")[1] == "pick/Execute\npick/parallel/PlanArm\n"
    assert type_in("break", "pick/parallel/PlanArm", "--off")[1] == "pick/Execute\n"
    assert "Breaks    pick/Execute\n" in type_in("status")[1]
    with served.client() as client, client.events("feedback") as events:
        goal = type_in("send", "1")[1].strip()
        assert any(event.phase == "paused" for event in events)  # type: ignore[union-attr]
        assert "PAUSED" in type_in("status")[1]
        assert type_in("break", "pick/Execute", "--off")[1] == "no breakpoints\n"
        assert type_in("resume")[0] == 0
        assert client.result(goal).success
    assert type_in("break", "--off")[0] == 2


def test_exit_statuses_are_those_of_run(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    for words, status in [
        (("send", "99", "--wait"), 4),
        (("send", "12", "--wait", "--set", "often=9"), 4),
        (("send", "12", "--wait", "--set", "often"), 4),
        (("send", "12", "--deadman", "--set", "what=hello"), 0),
        (("send", "13", "--wait"), 11),
        (("cancel", "zz"), 2),
        (("arm", "explode"), 2),
    ]:
        assert type_in(*words)[0] == status, words
    served.stop()
    status, _, error = type_in("status")
    assert status == 13
    assert "armtree serve" in error


def test_what_a_server_may_not_be(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    for words, status, said in [
        (("--tcp-port", str(served.server.port)), 13, "another port with --tcp-port"),
        (("--bind", "0.0.0.0"), 13, "add --expose"),
        (("--bind", "here"), 13, "is not an address"),
        (("--trees", "nowhere"), 3, "nowhere"),
        (("--policy", "both"), 2, "both"),
    ]:
        found, _, error = type_in("serve", "--port", "virtual", *words)
        assert (found, said in error) == (status, True), error


def test_a_changed_task_is_picked_up_and_a_wrong_one_is_not(
    typed: tuple[Served, Typed], monkeypatch: pytest.MonkeyPatch
) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    root, handler = logging.getLogger(), LogHandler(served.executive)
    monkeypatch.setattr(root, "handlers", [*root.handlers, handler])
    file = served.tasks / "12_say.yaml"
    assert type_in("send", "12", "--wait", "--set", "often=9")[0] == 4
    file.write_text(file.read_text().replace("max: 3", "max: 9"))
    assert type_in("send", "12", "--wait", "--set", "often=9")[0] == 0
    file.write_text("task: 12\nname: [")
    status, said, _ = type_in("send", "12", "--wait", "--set", "often=9")
    assert status == 0
    assert (
        "\nwarning: Task 12 runs in its last valid version, because its changed files are wrong:"
        in said
    )
    assert "12_say.yaml:2:7" in said
    events = map(json.loads, type_in("send", "12", "--wait", "--json")[1].splitlines())
    reported = [e["event"] for e in events if e.get("level", logging.WARNING) == logging.WARNING]
    assert [event for event in reported if event in ("goal", "log", "result")] == [
        "goal",
        "log",
        "result",
    ]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_a_motion_and_the_server(
    shell: Shell, number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    shell.serve("--activate", "--policy", "queue", "--rosbridge")
    for name, value in shell.environment.items():
        monkeypatch.setenv(name, value)
    with Client() as arm:  # a command would take longer to start than the motion lasts
        waiting = shell.begin([*ARMTREE, "send", "1", "--wait", "--json"])
        assert waiting.stdout
        assert any('"event": "sent"' in line for line in waiting.stdout)
        arm.send(0)
    assert shell.end(number) == 0
    reported = [json.loads(line) for line in waiting.communicate(timeout=30)[0].splitlines()]
    assert (waiting.returncode, reported[-1]["state"]) == (7, "CANCELED")
    holds = [event for event in reported if event["event"] == "sent" and event["hold"]]
    assert len(holds) == 1
    log = "".join(shell.log)
    assert log.count("ended CANCELED") == 1  # the other one had not started
    goal = re.findall(r"Received a goal for task 1 \((\w+)\)", log)[0]
    for said in (
        f"Received a goal for task 1 ({goal})",
        f"Executing the goal for task 1 ({goal})",
        f"Received a cancel of the goal for task 1 ({goal})",
        "WARNING ROSBRIDGE: any program on this machine",
    ):
        assert said in log
    assert not list(shell.folder.glob("armtree/*"))


def test_ctrl_c_in_a_client_cancels_its_goal(shell: Shell) -> None:
    shell.serve("--activate")
    waiting = shell.begin([*ARMTREE, "send", "1", "--wait", "--json"])
    assert waiting.stdout
    assert any('"event": "sent"' in line for line in waiting.stdout)
    waiting.send_signal(signal.SIGINT)
    reported = waiting.communicate(timeout=30)[0].splitlines()
    assert (waiting.returncode, json.loads(reported[-1])["state"]) == (7, "CANCELED")


@pytest.mark.parametrize(
    ("deadman", "number"),
    [(False, signal.SIGKILL), (True, signal.SIGKILL), (True, signal.SIGSTOP)],
)
def test_a_client_that_dies(shell: Shell, deadman: bool, number: signal.Signals) -> None:
    shell.serve("--activate")
    options = ["--deadman"] if deadman else ["--wait"]
    waiting = shell.begin([*ARMTREE, "send", "10", "--json", *options])
    shell.read("Executing the goal for task 10")
    waiting.send_signal(number)
    if deadman:
        shell.read("ended CANCELED")
    else:
        assert "EXECUTING" in shell.type("status").stdout
    waiting.kill()
    waiting.communicate()


def test_a_watcher_sees_what_others_do(shell: Shell) -> None:
    shell.serve("--activate")
    watching = shell.begin([*ARMTREE, "watch", "--json"])
    assert watching.stdout
    assert '"lifecycle"' in watching.stdout.readline()  # the present state comes first
    shell.type("send", "11")
    assert any('"event": "result"' in line for line in watching.stdout)
    watching.send_signal(signal.SIGINT)
    watching.communicate(timeout=30)
    assert watching.returncode == 130


def test_what_is_open_is_said_loudly(shell: Shell) -> None:
    shell.serve("--expose")
    assert re.search(
        r" on (http://127.*:\d+); .*reject; clients need --server \1\n", "".join(shell.log)
    )
    assert "WARNING EXPOSED: a machine" in "".join(shell.log)


def test_what_a_server_says_first_is_recorded_but_for_the_token(shell: Shell) -> None:
    folder = shell.folder / "recordings"
    folder.mkdir()
    left = folder / "20261121T103155.123Z-1.mcap"
    run_journal(left, finish=False)
    shell.serve("--expose")
    assert shell.end(signal.SIGTERM) == 0
    (own,) = folder.glob("*-server.mcap")
    lines = [line for line in Recording(own).records(LogLine) if isinstance(line, LogLine)]
    reported = "\n".join(line.message for line in lines)
    for words in (f"{left.name}: recovered", "Port virtual", "Listening on", "EXPOSED: a machine"):
        assert words in reported
        assert words in "".join(shell.log)
    token = re.search(r"Token .*: (\S+)", "".join(shell.log))
    assert token
    assert token[1].encode() not in own.read_bytes()
    assert token[1] not in reported


def test_a_server_that_does_not_answer_does_not_say_that_it_listens(shell: Shell) -> None:
    (shell.folder / "recordings").touch()  # its own recording cannot be made
    command = [*ARMTREE, "serve", "--port", "virtual", "--tcp-port", "0", "--trees", "tasks"]
    shell.server = shell.begin(command)
    _, said = shell.server.communicate(timeout=60)
    assert shell.server.returncode == 10
    assert "Token for requests" in said
    assert "Listening" not in said


def test_a_person_is_asked_for_the_pose_when_the_arm_is_activated(shell: Shell) -> None:
    text = shell.robot.read_text()
    shell.robot.write_text(text.replace("baud = ", "reset_on_open = false\nbaud = "))
    nowhere = "--port", str(shell.folder / "nowhere")
    shell.serve(*nowhere)
    while "inactive" not in shell.type("status").stdout:
        continue
    activating = shell.type("arm", "activate")
    assert activating.returncode == 6
    assert "give --pose boot" in activating.stderr
    assert "There is no serial port" in shell.type("arm", "activate", "--pose", "boot").stderr
    assert shell.end(signal.SIGTERM) == 0
    command = ("serve", *nowhere, "--robot", str(shell.robot), "--activate", "--tcp-port", "0")
    at_once = shell.type(*command)
    assert (at_once.returncode, "give --pose boot" in at_once.stderr) == (6, True)


def test_without_a_server_the_answer_comes_at_once() -> None:
    program = (
        "import sys; sys.argv = ['armtree', 'status', '--server', 'http://127.0.0.1:9']\n"
        "from executive.cli.main import main\n"
        "try:\n    main()\n"
        "finally:\n    print({'numpy', 'py_trees', 'skills'} & set(sys.modules))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stdout) == (13, "set()\n")
    assert ran.stderr.startswith(
        "Error: no server answers at http://127.0.0.1:9: Connection refused. Start one with"
    )


def test_view_opens_the_page_with_a_new_link(
    typed: tuple[Served, Typed], monkeypatch: pytest.MonkeyPatch
) -> None:
    served, type_in = typed
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    status, printed, _ = type_in("view")
    assert (status, opened) == (0, [printed.strip()])
    assert printed.startswith(f"{served.server.url}/#code=")
    status, printed, _ = type_in("view", "--print")
    assert (status, len(opened)) == (0, 1)
    assert printed.strip() not in opened
