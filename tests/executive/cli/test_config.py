"""`armtree config`, and the files that it shows."""

import json
import os
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from executive.cli import settings
from executive.cli.main import cli
from executive.cli.support import run_server
from executive.errors import BadConfiguration
from executive.setup import Setup


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder below which commands are typed; the user's files are beside it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "own"))
    below = tmp_path / "project" / "a" / "b"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)
    return tmp_path / "project"


def configure(folder: Path, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "armtree.toml"
    path.write_text(text)
    return path


def armtree(*words: str, **environment: str) -> Result:
    return CliRunner().invoke(cli, words, env=environment)


def shown(**environment: str) -> dict[str, tuple[Any, str]]:
    result = armtree("config", "--json", **environment)
    assert result.exit_code == 0, result.exception
    rows = [json.loads(line) for line in result.output.splitlines()]
    assert all(row["about"] for row in rows)
    return {row["setting"]: (row["value"], row["source"]) for row in rows}


def test_the_nearest_source_counts(project: Path) -> None:
    assert shown()["workers"] == (1, "default")
    own = configure(project.parent / "own" / "armtree", "workers = 2\nseed = 2\nkeep_mb = 2\n")
    configure(project, "workers = 9\n")
    near = configure(project / "a", "# nearer\nworkers = 3\nseed = 3")
    found = shown(ARMTREE_WORKERS="4")
    assert found["workers"] == (4, "ARMTREE_WORKERS")
    assert found["seed"] == (3, f"{near}:3")
    assert found["keep_mb"] == (2.0, f"{own}:3")
    assert found["keep_days"] == (None, "default")
    assert set(found) == set(settings.SETTINGS)


def test_the_rows_of_named_settings_are_shown(project: Path) -> None:
    configure(project, "seed = 3\n")
    result = armtree("config", "workers", "seed")
    assert result.exit_code == 0
    words = [line.split()[:2] for line in result.output.splitlines()[::2]]
    assert words == [["workers", "1"], ["seed", "3"]]
    assert "'sede' is not one of " in armtree("config", "sede").output


def test_every_setting_can_be_given_in_every_way(project: Path) -> None:
    values = {
        "port": "virtual",
        "server": "http://arm:1",
        "fleet": "nats://lab:4222",
        "policy": "queue",
        **dict.fromkeys(("robot", "trees", "skills", "world", "recordings"), str(project)),
    }
    numbers = {name: 7 for name in settings.SETTINGS if name not in values}
    everything: dict[str, str | int] = {**values, **numbers}
    file = configure(project, "".join(f"{k} = {json.dumps(v)}\n" for k, v in everything.items()))
    assert {name: value for name, (value, _) in shown().items()} == everything
    assert {source.rpartition(":")[0] for _, source in shown().values()} == {str(file)}
    given = {f"ARMTREE_{name.upper()}": str(value) for name, value in everything.items()}
    assert shown(**given) == {
        name: (value, f"ARMTREE_{name.upper()}") for name, value in everything.items()
    }


def test_a_relative_path_is_in_the_folder_of_its_file(project: Path) -> None:
    configure(project, 'recordings = "runs"\ntrees = "~/tasks"\n')
    found = shown(HOME="/home/ada")
    assert found["recordings"][0] == str(project / "runs")
    assert found["trees"][0] == "/home/ada/tasks"
    assert "runs: there are no recordings in this folder" in armtree("log", "ls").stderr


def test_commands_use_the_files(project: Path) -> None:
    configure(project, 'robot = "mine.toml"\nserver = "http://localhost:1"\n')
    result = armtree("check")
    assert str(project / "mine.toml") in str(result.exception)
    result = armtree("check", "--robot", "other.toml")
    assert "project" not in str(result.exception)
    assert "http://127.0.0.1:1" in str(armtree("status").exception)
    configure(project, "tcp_port = 2\n")
    assert "http://127.0.0.1:2" in str(armtree("status").exception)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("seed = 1\nprot = 1", ":2: prot: unknown key; did you mean port?"),
        ("prot = 1", "did you mean port?"),
        ("[serial]\nport = 1", ":1: serial: unknown key; this file has no tables"),
        ("port = 1", ":1: port: 1 is not a text"),
        ("seed = 0", ":1: seed: 0 is not from 1 to "),
        ("seed = 1.5", ":1: seed: 1.5 is not a whole number"),
        ("recording_timeout = 0", ":1: recording_timeout: 0.0 is not above 0"),
        ("recording_timeout = nan", ":1: recording_timeout: nan is not allowed"),
        ('policy = "quue"', ":1: policy: 'quue' is not one of "),
        ('\nserver = "arm"', ":2: server: 'arm' is not the URL of a server"),
        ("port = ", "armtree.toml:1: this is not a value; a text needs quotes"),
        ("port = '\xff'".encode("latin-1"), "armtree.toml: is not UTF-8 text"),
    ],
)
def test_a_wrong_file_is_reported_with_its_line(project: Path, text: str | bytes, why: str) -> None:
    path = configure(project, "")
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    for command in ("config", "tasks"):
        error = armtree(command).exception
        assert str(error).startswith(str(path))
        assert why in str(error)
        assert getattr(error, "code", "") == "file.settings"
    assert armtree("tasks", "--help").exit_code == 0


def test_a_file_of_another_user_in_a_shared_folder_is_not_read(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = configure(project, 'skills = "theirs"')
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert shown()["skills"][1] != "default"  # the folder is theirs, too
    stat = os.stat(path)
    theirs = os.stat_result((*stat[:4], 54321, *stat[5:]))
    found = Path.stat
    monkeypatch.setattr(
        Path, "stat", lambda self, **o: theirs if self == path else found(self, **o)
    )
    error = armtree("tasks").exception
    assert "belongs to another user" in str(error)


def test_without_a_file(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "There is no armtree.toml in this folder or a folder above" in armtree("config").output
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")  # not valid, by the XDG specification
    assert str(settings.user_file()).endswith("/.config/armtree/armtree.toml")
    gone = project / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert armtree("config").exit_code == 0


def test_an_unknown_variable_that_resembles_a_setting_is_reported_once(project: Path) -> None:
    others = {"ARMTREE_FLEET_CA": "x", "ARMTREE_TOKEN": "x", "ARMTREE_FUZZ_SEED": "1"}
    assert armtree("tasks", ARMTREE_SEED="3", **others).stderr == ""
    assert armtree("tasks", ARMTREE_SEDE="3", ARMTREE_RECORDING="x", **others).stderr == (
        "note: ARMTREE_RECORDING is not known; did you mean ARMTREE_RECORDINGS?\n"
        "note: ARMTREE_SEDE is not known; did you mean ARMTREE_SEED?\n"
    )


def test_what_is_wrong_in_a_file_follows_the_table(project: Path) -> None:
    configure(project, 'workers = 3\nseed = "x"\nprot = "virtual"\ntrace = 1\n')
    result = armtree("config")
    assert f"workers            3                              {project / 'armtree.toml'}:1" in (
        result.output
    )
    assert all(f"\n{name}" in result.output for name in settings.SETTINGS if name != "port")
    assert "Folder for recordings\n" in result.output
    assert isinstance(result.exception, BadConfiguration)
    said = re.split(rf"^{project}/armtree.toml:", str(result.exception), flags=re.MULTILINE)[1:]
    assert [each.partition(": ")[0] for each in said] == ["2", "3", "4"]
    assert "unknown key; did you mean port?\n" in said[1]
    assert said[1].endswith('  write:\n    port = "virtual"\n')


def test_a_server_waits_for_the_folder_of_tasks_that_a_file_names(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setups = list[Setup]()
    monkeypatch.setattr(run_server, "serve", lambda setup, *_: setups.append(setup))
    assert armtree("serve").exit_code == 0
    configure(project, 'trees = "later"\n')
    assert armtree("serve").exit_code == 0
    assert [each.trees for each in setups] == [None, None]
    assert [each.own_trees for each in setups] == [Path("trees"), project / "later"]


def test_a_folder_of_tasks_that_does_not_exist_yet_is_a_note(project: Path) -> None:
    file = configure(project, 'trees = "later"\n')
    result = armtree("tasks")
    assert result.exit_code == 0
    words = f"note: {file}:1: there is no folder {project / 'later'} yet; armtree new creates it"
    assert words in result.stderr
    assert "1  pick" in result.output
    assert "there is no such folder" in str(armtree("tasks", "--trees", "x").exception)
    assert armtree("new", "3", "wave").exit_code == 0
    assert (project / "later" / "arduinobot" / "3_wave.yaml").exists()


def test_the_next_command_of_a_new_task_leaves_out_what_a_file_sets(project: Path) -> None:
    configure(project, 'robot = "so101"\ntrees = "mine"')
    assert armtree("new", "4", "hop").output.splitlines()[-1] == (
        "Next, type: armtree check, then armtree run 4"
    )
    said = armtree("new", "5", "hop_again", "--trees", "other").output.splitlines()[-1]
    assert said == "Next, type: armtree check --trees other, then armtree run 5 --trees other"
