"""What commands print with --json, against the schemas in docs/output.schema.json."""

import asyncio
import json
import re
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import fastjsonschema
import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from executive.fleet.connection import open_fleet
from executive.fleet.nats_server import NatsOptions, nats_server
from executive.fleet.worker import Worker
from hardware import RealClock
from tests.support.command_line.typed import typed
from tests.support.paths import ROOT
from tests.support.servers.free_port import free_port
from tests.support.servers.simulated_arms import SimulatedArm
from trees import EXAMPLES

SCHEMA = json.loads((ROOT / "docs/output.schema.json").read_text())
RECORDING = EXAMPLES / "recordings/3_wave.mcap"


def printed(definition: str, *arguments: object, status: int = 0) -> list[Any]:
    """Return the objects that a command prints, each as the schema describes it."""
    result = CliRunner().invoke(cli, [*map(str, arguments), "--json"])
    assert result.exit_code == status, result.output
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    check = fastjsonschema.compile({**SCHEMA, "$ref": f"#/$defs/{definition}"})
    for row in rows:
        check(row)
    return rows


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    shutil.copy(RECORDING, path := tmp_path / RECORDING.name)
    return path


def test_log(recording: Path, tmp_path: Path) -> None:
    (row,) = printed("log_ls", "log", "ls", tmp_path)
    (info,) = printed("log_info", "log", "info", recording)
    assert not row.pop("pinned")
    assert row.items() <= info.items()
    assert (info["task"], info["name"], info["state"]) == (3, "wave", "SUCCEEDED")
    assert len(printed("log_show", "log", "show", recording)) > 5
    for row in printed("log_export", "log", "export", recording, "-o", tmp_path / "a/b"):
        assert Path(row["file"]).is_file()
    for row in printed("log_robot", "log", "robot", recording, "-o", tmp_path):
        assert Path(row["file"]).is_file()
    (pinned,) = printed("log_pin", "log", "pin", recording)
    assert pinned == {"file": str(recording), "pinned": True}
    assert printed("log_prune", "log", "prune", tmp_path, "--days", 0) == []
    printed("log_pin", "log", "pin", recording, "--off")
    (gone,) = printed("log_prune", "log", "prune", tmp_path, "--days", 0)
    assert gone == {"file": str(recording), "deleted": True}


def test_log_of_what_is_no_recording(tmp_path: Path) -> None:
    (tmp_path / "other.mcap").write_text("nothing")
    (row,) = printed("log_ls", "log", "ls", tmp_path)
    assert row["unreadable"]


def test_log_of_two_recordings(recording: Path) -> None:
    (same,) = printed("log_diff", "log", "diff", recording, RECORDING)
    assert same["same"]
    assert {joint["distance"] for joint in same["joints"].values()} == {0.0}
    other = RECORDING.with_name("8_round.mcap")
    (differs,) = printed("log_diff", "log", "diff", recording, other, status=12)
    assert differs["first"]
    (whole,) = printed("log_recover", "log", "recover", recording)
    assert (whole["recovered"], whole["whole"]) == (False, True)


@pytest.mark.slow
def test_log_plot(recording: Path) -> None:
    (row,) = printed("log_plot", "log", "plot", recording)
    assert Path(row["file"]).is_file()


def commands(of: click.Command, *names: str) -> Iterator[str]:
    """The names of the commands with --json."""
    if isinstance(of, click.Group):
        for name in of.list_commands(click.Context(of)):
            inner = of.get_command(click.Context(of), name)
            assert inner
            yield from commands(inner, *names, name)
    elif any("--json" in parameter.opts for parameter in of.params):
        yield " ".join(names)


def test_the_page_says_what_each_command_prints() -> None:
    page, _, _ = (ROOT / "docs/pages/reference/output.md").read_text().partition("## Events")
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("| `")]
    named = {name for words, _ in rows for name in re.findall("`(.+?)`", words)}
    assert {*commands(cli)} == {name.partition(" --")[0] for name in named}
    own = {
        name for words, kind in rows if "its own" in kind for name in re.findall("`(.+?)`", words)
    }
    defined = {name.replace(" --", "_").replace(" ", "_") for name in own}
    assert defined == {*SCHEMA["$defs"]} - {"place", "error"}


def test_lists_of_tasks_skills_poses_and_settings() -> None:
    rows = printed("tasks", "tasks", "--trees", EXAMPLES)
    assert "wave" in [row["name"] for row in rows]
    assert "PlanArm" in [row["skill"] for row in printed("skills", "skills")]
    assert "folded" in [row["pose"] for row in printed("pose_ls", "pose", "ls")]
    (folded,) = printed("pose_show", "pose", "show", "folded")
    assert len(folded["tool"]) == 3
    (opened,) = printed("pose_show", "pose", "show", "open")
    assert opened["tool"] is None
    assert {"port", "keep_mb"} <= {row["setting"] for row in printed("config", "config")}


@pytest.mark.slow
def test_verification() -> None:
    (row,) = printed("replay_verify", "replay", RECORDING, "--verify", "--jobs", 1)
    assert "plan -> frames" in [each["question"] for each in row["verdicts"]]


def test_robots() -> None:
    rows = {row["robot"]: row for row in printed("robots", "robots")}
    assert rows["so101"]["gripper"] == ["gripper"]
    assert rows["arduinobot"]["tasks"] == ["home", "pick", "rest"]
    assert Path(rows["arduinobot"]["file"]).is_file()


def test_check(tmp_path: Path) -> None:
    head = "task: 20\nname: m\ndescription: x\ntree:\n  sequence:\n"
    task = tmp_path / "20_m.yaml"
    task.write_text(f"{head}    - Set: {{value: 3, key: $n}}\n")
    (row,) = printed("check", "check", task)
    assert row["mistakes"] == []
    assert [(note["line"], note["message"][:16]) for note in row["notes"]] == [
        (6, "nothing reads $n")
    ]
    task.write_text(f"{head}    - Wait: 2 s\n")
    (row,) = printed("check", "check", task, status=3)
    assert [mistake["instead"] for mistake in row["mistakes"]] == ["    - Wait: {duration: 2 s}"]


@pytest.mark.usefixtures("undrawn")
def test_plan(tmp_path: Path) -> None:
    options = ("-o", tmp_path / "plan.png")
    (row,) = printed("plan", "plan", "joint_1=30deg", *options)
    (motion,) = row["motions"]
    assert motion["goal"][0] == pytest.approx(0.5236, abs=1e-4)
    assert motion["held_by"][0]["joint"] == "joint_1"
    (row,) = printed("plan", "plan", "pick", *options)
    assert row["motions"][0]["group"] == "arm"


def test_plan_refuses_an_option_that_it_does_not_have() -> None:
    result = CliRunner().invoke(cli, ["plan", "right", "--worlds", "x.json"])
    assert result.exit_code == 2
    assert "No such option" in result.output
    assert "Did you mean '--world'?" in result.output


@pytest.mark.usefixtures("undrawn")
def test_plan_takes_skills(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from skills import skill\n\n\n@skill\ndef planned_noop() -> None: ...\n"
    )
    (tmp_path / "30_x.yaml").write_text(
        "task: 30\nname: x\ndescription: x\ntree:\n  sequence:\n    - planned_noop\n"
        "    - {subtree: move_joints, with: {joints: {joint_1: 20 deg}}}\n"
    )
    words = ("30", "--trees", tmp_path, "--skills", tmp_path, "-o", tmp_path / "plan.png")
    (row,) = printed("plan", "plan", *words)
    assert row["motions"][0]["goal"][0] == pytest.approx(0.349, abs=1e-3)


@contextmanager
def fleet_of_one(folder: Path) -> Iterator[str]:
    """The URL of a fleet with the simulated arm bench.0."""
    options = NatsOptions(folder / "fleet", port=free_port())
    loop, ended = asyncio.new_event_loop(), asyncio.Event()

    async def work() -> None:
        async with open_fleet(options.url, "bench.0") as fleet, asyncio.TaskGroup() as group:
            arm = SimulatedArm(duration=0.0)
            worker = Worker(fleet, arm, "bench", "0", RealClock())
            group.create_task(worker.run())
            await ended.wait()
            worker.end()

    thread = threading.Thread(target=lambda: loop.run_until_complete(work()))
    with nats_server(options, RealClock()):
        thread.start()
        try:
            yield options.url
        finally:
            loop.call_soon_threadsafe(ended.set)
            thread.join()
            loop.close()


def test_fleet(tmp_path: Path) -> None:
    with fleet_of_one(tmp_path) as url:
        end, known = ("--fleet", url), list[Any]()
        while not (known and known[0]["state"] == "ready"):
            known = printed("fleet_ls", "fleet", "ls", *end)
        assert known[0]["arm"] == "bench.0"
        sent = ("fleet", "send", "1", "--pool", "bench", "--start-within", 60)
        queued, *_, ended = printed("fleet_send", *sent, "--wait", *end)
        assert (queued["event"], ended["job"]) == ("queued", queued["job"])
        assert ended["result"]["code"] == "ok"
        assert printed("fleet_jobs", "fleet", "jobs", *end) == [ended]
        (stopped,) = printed("fleet_stop", "fleet", "stop", *end)
        assert stopped["arm"] == "bench.0"
        (waits,) = printed("fleet_send", *sent, *end)
        (listed,) = printed("fleet_jobs", "fleet", "jobs", waits["job"], *end)
        assert listed["state"] == "QUEUED"
        (canceled,) = printed("fleet_jobs", "fleet", "cancel", waits["job"], *end)
        assert canceled["state"] == "CANCELED"
        assert len(printed("fleet_resume", "fleet", "resume", *end)) == 1


FAILURES = [
    ("plan nowhere", "goal.bad_target", 4, "'nowhere' is not a pose"),
    ("plan joint_1=900deg", "goal.out_of_bounds", 4, "900 deg"),
    ("plan --world none.json folded", "file.world", 3, "none.json"),
    ("plan", "usage", 2, "Missing argument"),
    ("check --nonsense", "usage", 2, "--nonsense"),
    ("check --robot none.toml", "file.robot", 3, "none.toml"),
    ("log show none.mcap", "log.unreadable", 3, "none.mcap"),
    ("log diff none.mcap latest", "log.no_such", 3, "no recording"),
    ("log plot none.mcap -o plot.xyz", "usage", 2, "plot.xyz"),
    ("tasks --trees none", "file.task", 3, "none"),
    ("tasks --robot none.toml", "file.robot", 3, "none.toml"),
    ("status --server http://127.0.0.1:9", "server.unreachable", 13, "armtree serve"),
    ("status --server nowhere", "usage", 2, "nowhere"),
]


@pytest.mark.parametrize(("line", "code", "status", "words"), FAILURES)
def test_an_error_is_one_object(
    line: str, code: str, status: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ended, out, err = typed(tmp_path, *line.split(), "--json")
    row = json.loads(out)
    fastjsonschema.compile({**SCHEMA, "$ref": "#/$defs/error"})(row)
    assert (ended, row["code"], row["exit_status"]) == (status, code, status)
    assert words in row["message"]
    assert words in err
    assert len(row["places"]) == (code in ("file.task", "file.world"))
