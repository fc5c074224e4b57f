"""The operator at the terminal: answers on standard input, from a pipe or from a keyboard."""

import os
import pty
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.end_to_end.test_command_line import robot

pytestmark = pytest.mark.slow

__all__ = ["robot"]

ARMTREE = [sys.executable, "-P", "-m", "armtree"]
TASK = """\
task: 9
name: careful
description: Ask before anything moves.
tree:
  sequence:
    - Ask: {question: Free?, wanted: yes}
    - Ask: {question: Name?, choices: [], answer: $name}
    - Say: {text: hello, value: $name}
"""


@pytest.fixture
def command(tmp_path: Path, robot: Path) -> list[str]:
    (tmp_path / "9_careful.yaml").write_text(TASK)
    folders = ["--trees", str(tmp_path), "--recordings", str(tmp_path / "recordings")]
    return [*ARMTREE, "run", "9", "--port", "virtual", "--robot", str(robot), *folders]


def piped(command: list[str], lines: str) -> tuple[int, str, str]:
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # without a terminal
    ) as process:
        out, err = process.communicate(lines, timeout=60)
    return process.returncode, out, err


def test_answers_come_from_a_pipe(command: list[str]) -> None:
    status, out, _ = piped(command, "perhaps\nYES\nAda")
    assert "? perhaps is not an answer to: Free? [yes/no]\n? Name?\n" in out
    assert "hello Ada" in out
    assert status == 0


def test_a_pipe_that_ends_leaves_no_operator(command: list[str]) -> None:
    status, out, _ = piped(command, "yes\n")
    assert "Name?: no answer is possible: standard input has ended" in out
    assert status == 11


def test_with_json_questions_go_to_standard_error(command: list[str]) -> None:
    _, out, err = piped([*command, "--json"], "no\n")
    assert err == "? Free? [yes/no]\n"
    assert '"code": "task.condition"' in out.splitlines()[-1]


@pytest.fixture
def keyboard() -> Iterator[tuple[int, int]]:
    master, slave = pty.openpty()
    yield master, slave
    os.close(master)
    os.close(slave)


def test_what_was_typed_before_the_question_answers_nothing(
    command: list[str], keyboard: tuple[int, int]
) -> None:
    master, slave = keyboard
    os.write(master, b"no\n")
    answers = {"? Free? [yes/no]\n": b"yes\n", "? Name?\n": b"Ada\n"}
    heard = ""
    with subprocess.Popen(
        command, stdin=slave, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout
        for line in process.stdout:
            heard += line
            os.write(master, answers.get(line, b""))
    assert "hello Ada" in heard
    assert process.returncode == 0


def test_in_the_background_of_a_shell_it_neither_reads_nor_stops(
    command: list[str], keyboard: tuple[int, int]
) -> None:
    job = f"set -m; {shlex.join(command)} & wait"
    done = subprocess.run(
        ["setsid", "--ctty", "--wait", "sh", "-c", job],
        check=True,
        stdin=keyboard[1],
        stdout=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    assert "no answer is possible: standard input has ended" in done.stdout
