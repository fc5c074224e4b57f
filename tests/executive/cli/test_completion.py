"""Completion of commands, as a shell asks for it and in real shells."""

import os
import pty
import re
import select
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.shell_completion import BashComplete, get_completion_class

from executive.cli import completion  # noqa: F401  adds to what click does for Bash
from executive.cli.main import cli
from executive.cli.support.command_group import COMPLETION_VARIABLE as VARIABLE
from tests.support.paths import EXAMPLES

PATIENCE = 60.0  # longer than any command takes [s]
ARMTREE = Path(sys.executable).with_name("armtree")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with two recordings."""
    (tmp_path / "recordings").mkdir()
    for name in ("20261121T103155.123Z-1.mcap", "20261122T103155.123Z-0.mcap"):
        (tmp_path / "recordings" / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def completed(*words: str) -> list[str]:
    """What the last word is completed to; files are left to the shell."""
    items = BashComplete(cli, {}, "armtree", VARIABLE).get_completions([*words[:-1]], words[-1])
    return [str(item.value) for item in items if item.type == "plain"]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["ru"], ["run"]),
        (["run", ""], ["home", "pick", "rest"]),
        (["run", "home", "p"], ["pick"]),
        (["send", "re"], ["rest"]),
        (["show", "p"], ["pick"]),
        (["run", "--trees", str(EXAMPLES), "wat"], ["watchful"]),
        (["plan", "p"], ["pick"]),
        (["plan", "fo"], ["folded"]),
        (["plan", "joint_4"], ["joint_4="]),
        (["move", "joint_1=5deg", "joint_"], [f"joint_{each}=" for each in (1, 2, 3, 4)]),
        (["move", "fo"], ["folded"]),
        (["move", "wid"], ["width="]),
        (["move", "--robot", "so101", "gri"], ["gripper="]),
        (["break", "pi"], ["pick/"]),
        (["break", "pick/E"], ["pick/Execute"]),
        (["break", "nothing/E"], []),
        (["run", "--port", "virt"], ["virtual"]),
        (["replay", "--on", "virt"], ["virtual"]),
        (["run", "--robot", "so"], ["so101"]),
        (["serve", "--robot", ""], ["arduinobot", "so101"]),
        (["pose", "show", "ho"], ["home"]),
        (["pose", "rm", ""], []),
        (["log", "show", "20261121"], ["20261121T103155.123Z-1.mcap"]),
        (["log", "diff", "x", "latest"], ["latest", "latest:home", "latest:pick", "latest:rest"]),
        (["replay", "2026"], ["20261122T103155.123Z-0.mcap", "20261121T103155.123Z-1.mcap"]),
        (["arm", "de"], ["deactivate"]),
        (["serve", "--policy", "q"], ["queue"]),
        (["completion", "f"], ["fish"]),
    ],
)
def test_a_word_is_completed(words: list[str], found: list[str]) -> None:
    assert completed(*words) == found


def test_what_is_wrong_completes_nothing_and_prints_nothing(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "armtree.toml").write_text("prot = 1")
    assert completed("run", "p") == ["pick"]
    (folder / "armtree.toml").write_text('trees = "gone"\nrecordings = "gone"')
    assert completed("run", "p") == completed("plan", "fo") == completed("break", "x/y") == []
    assert completed("log", "info", "l") == ["latest"]
    assert completed("run", "--skills", "gone", "--trees", str(EXAMPLES), "wat") == ["watchful"]
    assert completed("nonsense", "x", "y") == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("armtree log info latest:pi", ["pick"]),
        ("armtree log info latest:", ["home", "pick", "rest"]),
        ("armtree run --port=virt", ["virtual"]),
        ("armtree run ", ["home", "pick", "rest"]),
        ("armtree break pick/E", ["pick/Execute"]),
    ],
)
def test_bash_gets_what_follows_its_break(
    line: str, found: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COMP_LINE", line)
    monkeypatch.setenv("COMP_WORDBREAKS", " \t\n\"'><=;|&(:")
    kind = get_completion_class("bash")
    assert kind
    lines = kind(cli, {}, "armtree", VARIABLE).complete().splitlines()
    assert [line.removeprefix("plain,") for line in lines if line.startswith("plain")] == found


class Shell:
    """An interactive shell on a pseudo-terminal."""

    def __init__(self, command: list[str], folder: Path) -> None:
        self._seen = ""
        self._process, self._terminal = pty.fork()
        if self._process == 0:  # the shell
            os.chdir(folder)
            kept = {k: v for k, v in os.environ.items() if not k.startswith(("ARMTREE", "BASH"))}
            environment = {**kept, "HOME": str(folder), "TERM": "xterm", "INPUTRC": os.devnull}
            os.execvpe(command[0], command, environment)

    def type(self, text: str, until: str) -> str:
        """Type a text; return what is printed from then on, up to a text."""
        os.write(self._terminal, text.encode())
        shown = ""
        while until not in (plain := re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]|\x1b[=>()][B0]?", "", shown)):
            ready, _, _ = select.select([self._terminal], [], [], PATIENCE)
            assert ready, f"{until!r} is not in {plain!r}"
            try:
                shown += os.read(self._terminal, 4096).decode(errors="replace")
            except OSError as error:  # the shell has ended
                raise AssertionError(f"{until!r} is not in {plain!r}") from error
        return plain

    def close(self) -> None:
        os.kill(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)
        os.close(self._terminal)


SHELLS = {
    "bash": (["bash", "--norc", "-i"], 'eval "$({} completion bash)"'),
    "zsh": (["zsh", "-f", "-i"], 'eval "$({} completion zsh)"'),
    "fish": (["fish", "--no-config", "-i"], "{} completion fish | source"),
}


@pytest.fixture(params=SHELLS)
def shell(request: pytest.FixtureRequest, folder: Path) -> Iterator[Shell]:
    command, load = SHELLS[request.param]
    if not shutil.which(command[0]):
        pytest.skip(f"{command[0]} is not installed")
    made = Shell(command, folder)
    quotes = "''"  # so that the echo of the line is not taken for its output
    made.type(f"alias armtree={ARMTREE}; {load.format(ARMTREE)}; echo rea{quotes}dy\n", "ready")
    yield made
    made.close()


@pytest.mark.slow
def test_in_a_real_shell(shell: Shell) -> None:
    assert "Traceback" not in shell.type("armtree sho", "armtree sho")
    shell.type("\t", "w")
    shell.type("p\t", "ck")
    assert "SetStart" in shell.type("\n", "Succeed")
    shell.type("echo log=latest:no; armtree log info latest:pi", "latest:pi")
    shell.type("\t", "ck")
    shell.type("\x15armtree run --port virt\t", "ual")
    shell.type("\x15armtree break pic\t", "k/")
    shell.type("E\t", "xecute")  # no space is between
    shell.type("\x15armtree move wid\t", "th=")
    shell.type("20mm\x01echo \n", "armtree move width=20mm")
