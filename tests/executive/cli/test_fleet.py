"""What `armtree fleet` refuses, and how its commands print arms and jobs."""

import asyncio
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import pytest

from executive.api.outcome import Cause, Ending, GoalState
from executive.cli.fleet import fleet
from executive.cli.terminal.fleet_tables import arms_table, job_row, job_text, top
from executive.fleet import fleet_client
from executive.fleet.fleet_client import ArmRow, FleetClient
from executive.fleet.programs import run
from executive.fleet.values import Job, JobRecord, Member, Presence, from_bytes, to_bytes
from tests.support.command_line.typed import typed
from tests.support.paths import ROOT
from tests.support.servers.fleet_arms import joined
from tests.support.servers.simulated_arms import SimulatedArm

pytest_plugins = ["tests.support.servers.fleet_fixtures"]

JOB = Job("a" * 32, "bench", "wave", {"swing": "20 deg"}, 1)
RECORD = JobRecord(JOB, "bench.arm-7", "http://arm:8765", "b" * 32, 2)


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("ls --fleet http://arm:4222", 2, "not the URL of a fleet, such as nats://127.0.0.1:4222"),
        (
            "ls --fleet nats://lab:secret@127.0.0.1:9",
            13,
            "no fleet answers at nats://127.0.0.1:9: Connection refused. Start one",
        ),
        (
            "ls --fleet nats://[::1]:9",
            13,
            "no fleet answers at nats://[::1]:9: Connection refused.",
        ),
        ("send 0 --id 12", 2, "is not the id of a goal"),
        ("up --bind 0.0.0.0", 2, "--bind 0.0.0.0 would let other machines move every arm"),
        ("up --bind 0.0.0.0 --tls-cert c --tls-key k", 2, "[fleet.unsafe]"),
        ("join --pool a.b --name c", 2, "'a.b' is not the name of a pool"),
        ("up --use foo:bar", 2, "not the URL of a fleet, such as nats://127.0.0.1:4222"),
    ],
)
def test_what_is_refused(words: str, status: int, said: str, tmp_path: Path) -> None:
    found, _, errors = typed(tmp_path, "fleet", *words.split())
    assert found == status, errors
    assert said in " ".join(errors.split())


@pytest.mark.parametrize("words", ["--name arm-7", "--pool bench"])
def test_a_place_in_no_fleet_is_refused(words: str, tmp_path: Path) -> None:
    status, _, errors = typed(tmp_path, "serve", "--port", "virtual", *words.split())
    assert status == 2
    assert "--name and --pool need --fleet URL" in errors


@pytest.mark.parametrize("command", ["ls", "jobs", "top", "stop"])
def test_a_library_that_is_missing_is_named(command: str) -> None:
    code = "import sys; sys.modules['nats'] = None; import armtree; armtree.main()"
    words = [sys.executable, "-c", code, "fleet", command]
    found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 13
    assert found.stderr.startswith("Error: nats-py is not installed; type `make fleet`")


@pytest.mark.parametrize("content", [None, "garbage"])
@pytest.mark.parametrize(
    ("variable", "url"),
    [
        ("ARMTREE_FLEET_NKEY", "nats://127.0.0.1:9"),
        ("ARMTREE_FLEET_CA", "tls://127.0.0.1:9"),
    ],
)
def test_a_wrong_file_of_a_key_or_certificate_is_named(
    variable: str, url: str, content: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    if content:
        path.write_text(content)
    monkeypatch.setenv(variable, str(path))
    found, _, errors = typed(tmp_path, "fleet", "ls", "--fleet", url)
    assert found == 13, errors
    said = " ".join(errors.split())
    assert f"{variable} names {path}: " in said
    assert said.endswith("[fleet.bad_credentials]")


def test_a_key_is_written_once_and_private(tmp_path: Path) -> None:
    path = tmp_path / "arm.nkey"
    status, public, _ = typed(tmp_path, "fleet", "key", str(path))
    assert (status, public[0], len(public.strip())) == (0, "U", 56)
    assert path.stat().st_mode & 0o777 == 0o600
    assert typed(tmp_path, "fleet", "key", str(path))[0] == 3


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A process that Ctrl-C interrupts. Processes of pytest-xdist ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_cancels_a_job_that_is_waited_for(
    url: str, interruptible: None, capsys: pytest.CaptureFixture[str]
) -> None:
    arm, ready = SimulatedArm(), threading.Event()

    async def serve() -> None:
        async with joined(url, arm):
            ready.set()
            await arm.started.wait()
            os.kill(os.getpid(), signal.SIGINT)
            await arm.result(arm.received[0])

    serving = threading.Thread(target=asyncio.run, args=(serve(),))
    serving.start()
    assert ready.wait(20)
    with pytest.raises(click.Abort):
        fleet.main(
            ["send", "0", "--pool", "bench", "--wait", "--fleet", url], standalone_mode=False
        )
    serving.join()
    assert "CANCELED   task 0 on bench.0" in capsys.readouterr().out


def test_ctrl_c_also_cancels_a_job_that_is_being_sent(
    url: str,
    interruptible: None,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    publish = fleet_client.publish

    async def interrupt(*sent: Any) -> bool:
        repeated = await publish(*sent)
        os.kill(os.getpid(), signal.SIGINT)
        await asyncio.sleep(0.01)  # the signal arrives before the answer
        return repeated

    async def is_served(*_: object) -> bool:
        return True

    monkeypatch.setattr(fleet_client, "publish", interrupt)
    monkeypatch.setattr(FleetClient, "_is_served", is_served)
    with pytest.raises(click.Abort):
        fleet.main(["send", "0", "--wait", "--fleet", url], standalone_mode=False)
    assert "CANCELED   task 0 on no arm" in capsys.readouterr().out


def test_ctrl_c_ends_a_command_though_a_library_loses_the_first_cancel(
    url: str, interruptible: None
) -> None:
    async def act(_: FleetClient) -> None:
        asyncio.get_running_loop().call_soon(os.kill, os.getpid(), signal.SIGINT)
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            await asyncio.Event().wait()

    with pytest.raises(KeyboardInterrupt):
        run(url, act)


def test_top_prints_lines_to_a_pipe(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    async def read(client: FleetClient) -> None:
        showing = asyncio.create_task(top(client))
        async with asyncio.timeout(10):
            while not (printed := capsys.readouterr().out):
                await asyncio.sleep(0)
        showing.cancel()
        assert printed.startswith("Queued jobs: 0\n")

    run(url, read)


def test_a_stop_of_an_empty_fleet_says_so(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    fleet.main(["stop", "--fleet", url], standalone_mode=False)
    assert capsys.readouterr().err == "no arm has joined, so none confirmed the stop\n"


def test_arms_and_jobs_are_lines() -> None:
    member = Member("bench.arm-7", "http://arm:8765", "arm", "b" * 32, 1)
    rows = [ArmRow(member, Presence("b" * 32, "busy", "a" * 32, "ok", 3)), ArmRow(member, None)]
    _, busy, gone = arms_table(rows)
    assert busy.split() == ["bench.arm-7", "busy", "ok", "http://arm:8765", "a" * 32]
    assert gone.split() == ["bench.arm-7", "gone", "-", "http://arm:8765", "-"]
    assert rows[1].to_json()["state"] == "gone"
    assert job_text(JOB) == f"{JOB.identity}  QUEUED     task wave for bench, normal"
    assert job_text(RECORD) == f"{JOB.identity}  CLAIMED    task wave on bench.arm-7"
    cause = Cause("fleet.arm_lost", "gone", hint="look at it")
    lost = replace(RECORD, result=Ending(GoalState.ABORTED, cause.code, "gone", cause=cause))
    assert from_bytes(JobRecord, to_bytes(lost)) == lost
    assert job_text(lost).splitlines()[1:] == ["  gone [fleet.arm_lost]", "  -> look at it"]
    assert job_row(lost)["result"]["code"] == "fleet.arm_lost"
    assert (job_row(JOB)["job"], job_row(JOB)["state"]) == (JOB.identity, "QUEUED")
