"""The help of every command, at every width; and the options that every command takes."""

import logging
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from executive.cli.main import SECTIONS, cli
from executive.cli.settings import SETTINGS
from tests.support.command_line.commands import commands_of
from tests.support.command_line.typed import typed
from trees import UnknownTask


def commands(group: click.Group, *before: str) -> Iterator[tuple[str, ...]]:
    """Yield the names of a group's commands, those of groups within it too."""
    for name, command in commands_of(group).items():
        yield (*before, name)
        if isinstance(command, click.Group):
            yield from commands(command, *before, name)


COMMANDS = [(), *commands(cli)]


def help_of(*words: str) -> str:
    result = CliRunner().invoke(cli, [*words, "--help"])
    assert result.exit_code == 0
    return result.output


@pytest.mark.parametrize("width", ["60", "80", "200"])
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_no_line_of_the_help_is_cut(
    words: tuple[str, ...], width: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", width)
    _, text, _ = typed(tmp_path, *words, "--help")
    cut = [line for line in text.splitlines() if re.search(r"[a-z]\.\.\.$", line)]
    assert [line for line in text.splitlines() if len(line) > int(width)] + cut == []


def test_every_command_is_in_one_section() -> None:
    _, *sections = help_of().partition("Options:")[2].split("\n\n")
    assert all(re.fullmatch(r"[A-Z][a-z ]+:", section.splitlines()[0]) for section in sections)
    lines = [line for section in sections for line in section.splitlines()[1:]]
    assert sorted(re.findall(r"^  (\S+)", "\n".join(lines), re.M)) == sorted(commands_of(cli))


def test_the_list_of_commands_has_the_first_sentence_of_each_help() -> None:
    listed = {each: words for section in SECTIONS.values() for each, words in section.items()}
    described = commands_of(cli).values()
    assert [*listed.values()] == [each.get_short_help_str(limit=10_000) for each in described]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_options_are_in_sections(words: tuple[str, ...]) -> None:
    text = help_of(*words)
    assert not re.search(r"^  -.* (TEXT|INTEGER|FLOAT|PATH|RANGE)\b", text, re.M)
    if "Commands:" in text or not words:
        return
    own, _, common = text.partition("Options of every command:")
    own, _, settings = own.partition("Settings, also in armtree.toml")
    assert re.findall(r"--\w+", common) == ["--verbose", "--debug", "--help"]
    flags = {f"--{name.replace('_', '-')}" for name in SETTINGS}
    assert not flags & set(re.findall(r"^  (--[\w-]+)", own.partition("Options:")[2], re.M))
    assert flags >= set(re.findall(r"^  (--[\w-]+)", settings, re.M))


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_takes_verbose_and_debug(words: tuple[str, ...]) -> None:
    text = help_of(*words)
    assert "--verbose" in text
    assert "--debug" in text


@pytest.mark.parametrize("words", [("--debug", "show", "99"), ("show", "99", "--debug")])
def test_debug_adds_the_traceback_wherever_it_is(words: tuple[str, ...], tmp_path: Path) -> None:
    status, _, debugged = typed(tmp_path, *words)
    assert status == UnknownTask.exit_status
    assert typed(tmp_path, "show", "99")[::2] == (status, debugged.splitlines(keepends=True)[-1])
    assert debugged.startswith("Traceback")


def test_wrong_usage_has_no_traceback(tmp_path: Path) -> None:
    status, out, error = typed(tmp_path, "--debug", "show")
    assert (status, out, error.startswith("Error: Missing argument")) == (2, "", True)


def test_the_choices_of_a_missing_argument_are_in_one_line(tmp_path: Path) -> None:
    error = typed(tmp_path, "completion")[2]
    choices = "Choose from: bash, zsh, fish; write armtree completion SHELL; "
    assert (
        error
        == f"Error: Missing argument 'SHELL'. {choices}see armtree completion --help [usage]\n"
    )


@pytest.mark.parametrize("words", [("-v", "check"), ("check", "--verbose"), ("-v", "check", "-v")])
def test_the_log_is_printed_wherever_verbose_is(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def load_skills(*_: object) -> list[str]:
        logging.getLogger("armtree").info("a line")
        return []

    monkeypatch.setattr("skills.user_skills.load_skills", load_skills)
    assert typed(tmp_path, *words, "no.yaml")[2].count("INFO armtree: a line\n") == 1
    assert "a line" not in typed(tmp_path, "check", "no.yaml")[2]


_FILE = "is a file; a task has a number or a name: write wave"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (
            "run 1 --swing 3",
            "option '--swing'; for a parameter of the task write --set swing=VALUE",
        ),
        ("run 1 swing=3", "TASK...: swing=3 is a parameter of a task: write --set swing=3"),
        ("run pick,home", "TASK...: write tasks without commas: pick home"),
        ("run trees/3_wave.yaml", f"TASK...: trees/3_wave.yaml {_FILE}"),
        ("run mine/3_wave.yaml", f"TASK...: mine/3_wave.yaml {_FILE} --trees mine"),
        ("move --joint_1 3", "'--joint_1'; for a joint write joint_1=VALUE, without dashes"),
        ("teach fetch 7", "NUMBER: fetch is not a whole number; write armtree teach NUMBER NAME"),
        ("pose save left x=1", "extra argument (x=1); write armtree pose save NAME"),
    ],
)
def test_wrong_arguments_are_corrected(words: str, why: str, tmp_path: Path) -> None:
    status, _, errors = typed(tmp_path, *words.split())
    assert (status, errors.count("\n")) == (2, 1)
    assert f"{why}; see armtree {words.split()[0]}" in errors


def test_an_unknown_command_with_arguments_is_no_recording(tmp_path: Path) -> None:
    errors = typed(tmp_path, "log", "rm", "latest")[2]
    assert errors == "Error: No such command 'rm'; see armtree log --help [usage]\n"


@pytest.mark.parametrize(
    ("words", "near"),
    [
        ("mvoe", "; did you mean move?"),
        ("pose sve", "; did you mean save?"),
        ("log latest", "; did you mean armtree log show latest?"),
        ("list", "; did you mean tasks?"),
        ("goto", "; did you mean move?"),
        ("pose delete", "; did you mean rm?"),
        ("xyz", "; see armtree --help"),
    ],
)
def test_a_misspelt_command_is_corrected(words: str, near: str, tmp_path: Path) -> None:
    """A command that is not imported yet is suggested, too."""
    status, out, errors = typed(tmp_path, *words.split())
    assert (status, out) == (2, "")
    assert errors == f"Error: No such command {words.split()[-1]!r}{near} [usage]\n"
