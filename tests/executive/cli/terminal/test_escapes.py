"""What comes from files, servers and skills cannot control the terminal."""

import io
import json
import logging
import socket
import threading
from pathlib import Path

import pytest
from rich.console import Console

import logs
from executive.api.outcome import Cause, GoalState, Outcome
from executive.cli.terminal.line_view import view_for
from executive.cli.terminal.live.live_view import LiveView
from executive.cli.terminal.log_printer import LogPrinter
from executive.cli.terminal.streams import echo_result
from tests.support.servers.serving import Served, Typed

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

EVIL = "\x1b]0;owned\x07\x1b[2J\x9b1A\r\u202e"
TASK = f"""task: 60
name: evil
description: {json.dumps("Say " + EVIL)}
tree:
  sequence:
    - Say: {{text: {json.dumps(EVIL)}, value: 1}}
    - Fail: {{reason: {json.dumps(EVIL + chr(10) + "Error: forged")}}}
"""


def clean(text: str) -> bool:
    return all(each.isprintable() or each in "\n\t" for each in text)


@pytest.mark.parametrize(
    "words",
    [
        ("tasks", "--trees", "evil"),
        ("check", "--trees", "evil"),
        ("show", "60", "--trees", "evil"),
        ("show", "60", "--trees", "evil", "--format", "dot"),
        ("check", "bad.yaml"),
        ("doctor", "--port", f"/dev/{EVIL}"),
        ("answer", EVIL),
        ("break", EVIL),
        ("log", "info", EVIL),
        ("log", "no" + EVIL),
        ("run", "60", "--trees", "evil", "--port", "virtual"),
        ("run", EVIL),
    ],
    ids=lambda words: words[0],
)
def test_commands(
    typed: tuple[Served, Typed],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("evil").mkdir()
    Path("evil/60_evil.yaml").write_text(TASK)
    Path("bad.yaml").write_text(f"task: {json.dumps(EVIL)}\n")
    _, type_in = typed
    _, output, errors = type_in(*words)
    assert output + errors
    assert clean(output), output
    assert clean(errors), errors


def test_errors_of_a_server(typed: tuple[Served, Typed]) -> None:
    error: dict[str, object] = {
        "code": "goal.busy",
        "message": f"{EVIL}\nError: forged",
        "hint": EVIL,
    }
    error |= dict.fromkeys(("node", "joint", "place", "argument"), EVIL)
    error |= {"value": None, "limit": None}
    body = json.dumps(error).encode()
    head = f"HTTP/1.1 409 Conflict\r\ncontent-length: {len(body)}\r\n\r\n"
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(65_536)
                connection.sendall(head.encode() + body)

        threading.Thread(target=answer, daemon=True).start()
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        status, output, errors = typed[1]("status", "--server", url)
    assert (status, output) == (4, "")
    assert clean(errors), errors
    assert [line for line in errors.splitlines() if line.startswith("Error")] == [
        errors.splitlines()[0]
    ]


def test_the_log() -> None:
    line = logging.LogRecord("skill", logging.INFO, "", 1, f"{EVIL}\n2026 ERROR forged", (), None)
    shown = LogPrinter("%(levelname)s %(message)s").format(line)
    assert clean(shown)
    assert [each[:4] for each in shown.splitlines()] == ["INFO", "    "]


@pytest.mark.parametrize("as_json", [True, False])
def test_further_lines_of_a_message_are_indented(
    capsys: pytest.CaptureFixture[str], as_json: bool
) -> None:
    """In the lines of a run, and in what commands print."""
    text = "why\nError: forged"
    with view_for(as_json, verbose=True) as view:
        view.put(logs.NodeStatus(0.0, "a", "node", "FAILURE", text))
        view.put(text)
        view.put(Outcome.of(60, GoalState.ABORTED, Cause("task.failed", text, hint=text)))
    echo_result(as_json, {"text": text}, text, "next")
    lines = capsys.readouterr().out.splitlines()
    assert lines
    assert not [line for line in lines if line.startswith("Error")]
    assert as_json or lines[-1] == "next"


def test_the_live_view() -> None:
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, color_system=None, width=200)
    with LiveView(console) as view:
        view.put(logs.Goal(0.0, "ab" * 16, 60, f"name{EVIL}", 0))
        view.put(logs.NodeStatus(0.0, "a", f"node{EVIL}", "RUNNING", f"words{EVIL}"))
        view.put(logs.Feedback(0.0, "ab" * 16, 5, f"phase{EVIL}", ""))
        view.put(logs.Transition(0.0, "a", "b", f"arm{EVIL}"))
        view.put(f"said{EVIL}")
    with LiveView(console) as view:
        view.put(Outcome.of(60, GoalState.ABORTED, Cause("task.failed", f"why{EVIL}")))
    shown = stream.getvalue()
    assert all(word in shown for word in ("name", "node", "words", "phase", "arm", "said", "why"))
    assert "\x1b]" not in shown
    assert not {"\x07", "\x9b", "\u202e"} & set(shown)
