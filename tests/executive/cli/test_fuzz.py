"""Any arguments and files: each command ends in time, with a status and words of its own.

`ARMTREE_FUZZ=5000 ARMTREE_FUZZ_SEED=7 pytest tests/executive/cli/test_fuzz.py` tries more of them.
"""

import os
import random
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import click
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, Phase, given, seed, settings, strategies as st

from executive.cli.main import cli
from executive.cli.support.failures import print_error
from tests.support.command_line.commands import commands_of
from tests.support.paths import ROBOT_FILE

pytestmark = pytest.mark.slow

EXAMPLES = int(os.environ.get("ARMTREE_FUZZ", "75"))
LONGEST_S = 60  # also on a busy machine
SAMPLE = Path("trees/examples/recordings/3_wave.mcap").resolve()

# These last until Ctrl-C, or change the process that runs them; rows of tests/faults start them.
LEFT_OUT = {"fleet join", "fleet top", "fleet up", "mcp", "ros2", "run", "serve", "view", "watch"}
LEFT_OUT_OPTIONS = {"--on", "--watch", "--open", "--jobs"}

WORDS = [
    *("", "-", "--", "0", "1", "-1", "3", "nan", "inf", "1e999", "9" * 5000, "0x10", "1_0"),
    *("a", "..", "x" * 5000, "a\nb", "\x1b[2J", "\ufeff", "\udc80", "{", "[[[[", "$x", "%s", "*"),
    *("joint_1=20deg", "joint_1=nan", "=", "a=b=c", "swing=[1,", "right", "point=0.1,0,0.2"),
    *("http://127.0.0.1:1", "http://", "http://[", "https://x:99999", "--help", "-v", "--debug"),
]


def commands() -> dict[str, click.Command]:
    """Each command with its words."""
    found: dict[str, click.Command] = {}
    for name, command in commands_of(cli).items():
        if isinstance(command, click.Group):
            found |= {f"{name} {inner}": one for inner, one in commands_of(command).items()}
        else:
            found[name] = command
    return {name: command for name, command in found.items() if name not in LEFT_OUT}


COMMANDS = commands()


def files(folder: Path) -> list[str]:
    """Files that commands do not expect, by their names."""
    noise, sample = random.Random(1).randbytes(3000), SAMPLE.read_bytes()
    contents = {
        "empty": b"",
        "noise": noise,
        "noise.mcap": sample[:100] + noise,
        "cut.mcap": sample[: len(sample) // 2],
        "whole.mcap": sample,
        "brackets": b"a = " + b"[" * 100_000,
        "brackets.json": b"[" * 100_000,
        "wrong.json": b'[{"name": "b", "box": {"size": [1, 1, NaN]}}]',
        "robot.toml": ROBOT_FILE.read_bytes()[:900],
        "9_x.yaml": b"task: 9\nname: x\ndescription: y\ntree:\n  Say: {text: z}\n",
        "8_y.yaml": b"task: [" * 300,
        "noise.py": noise,
    }
    for name, data in contents.items():
        (folder / name).write_bytes(data)
    os.mkfifo(folder / "pipe")
    os.mkfifo(folder / "pipe.png")
    (folder / "folder").mkdir()
    (folder / "loop").symlink_to("loop")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(folder / "socket"))
    others = ["pipe", "pipe.png", "folder", "loop", "socket", ".", "/dev/zero", "/dev/full", "/"]
    return [*contents, *others, "missing/x", "empty/x", "x" * 300]


@st.composite
def lines(draw: st.DrawFn, names: list[str]) -> list[str]:
    """A command with some of its options, and about as many arguments as it takes."""
    name = draw(st.sampled_from(sorted(COMMANDS)))
    texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
    values = st.one_of(st.sampled_from(WORDS), st.sampled_from(names), texts)
    parts: list[list[str]] = []
    for parameter in COMMANDS[name].params:
        if isinstance(parameter, click.Argument):
            count = draw(st.sampled_from([1, 1, 1, 2, 0]))
            parts += [[draw(values)] for _ in range(count)]
        elif not LEFT_OUT_OPTIONS.intersection(parameter.opts) and draw(st.integers(0, 4)) == 0:
            flag = isinstance(parameter, click.Option) and parameter.is_flag
            parts.append([parameter.opts[0], *([] if flag else [draw(values)])])
    parts = draw(st.permutations(parts))
    return [*name.split(), *(word for part in parts for word in part)]


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[str]]:
    """The names of files in the current folder."""
    before, folder = Path.cwd(), tmp_path_factory.mktemp("fuzz")
    os.chdir(folder)
    yield files(folder)
    os.chdir(before)


def test_any_arguments_end_with_a_status_and_words(
    names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # As root, `service remove --yes` would change the services of this computer.
    monkeypatch.setattr(os, "geteuid", lambda: 1000)

    @seed(int(os.environ.get("ARMTREE_FUZZ_SEED", "0")))
    @settings(
        max_examples=EXAMPLES,
        phases=[Phase.generate],
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(line=lines(names))
    def each(line: list[str]) -> None:
        check(line)

    each()


def check(line: list[str]) -> None:
    signal.signal(signal.SIGALRM, hang)
    signal.alarm(LONGEST_S)
    try:
        environment = {"ARMTREE_TCP_PORT": "1", "ARMTREE_SERVER": "", "ARMTREE_PORT": "virtual"}
        result = CliRunner().invoke(cli, line, env=environment)
    finally:
        signal.alarm(0)
    error = result.exception
    status = result.exit_code
    if isinstance(error, Exception):
        assert not isinstance(error, TimeoutError), f"{line} does not end"
        status = print_error(error)
    assert status != 1, f"{line}: {error!r}"
    assert "Traceback" not in result.output, line


def hang(number: int, frame: FrameType | None) -> None:
    raise TimeoutError
