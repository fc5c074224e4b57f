"""What `armtree fleet` refuses, and how its commands print arms and jobs."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from executive.api.outcome import Cause, Ending, GoalState
from executive.cli.terminal.fleet_tables import arms_table, job_row, job_text
from executive.fleet.fleet_client import ArmRow
from executive.fleet.values import Job, JobRecord, Member, Presence, from_bytes, to_bytes
from tests.support.command_line.typed import typed
from tests.support.paths import ROOT

JOB = Job("a" * 32, "bench", "wave", {"swing": "20 deg"}, 1)
RECORD = JobRecord(JOB, "bench.arm-7", "http://arm:8765", "b" * 32, 2)


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("ls --fleet http://arm:4222", 2, "not the URL of a fleet, such as nats://127.0.0.1:4222"),
        ("ls --fleet nats://127.0.0.1:9", 13, "[fleet.unreachable]"),
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


def test_arms_and_jobs_are_lines() -> None:
    member = Member("bench.arm-7", "http://arm:8765", "arm", "b" * 32, 1)
    rows = [ArmRow(member, Presence("b" * 32, "busy", "a" * 32, "ok", 3)), ArmRow(member, None)]
    _, busy, gone = arms_table(rows)
    assert busy.split() == ["bench.arm-7", "busy", "a" * 8, "ok", "http://arm:8765"]
    assert gone.split() == ["bench.arm-7", "gone", "-", "-", "http://arm:8765"]
    assert rows[1].to_json()["state"] == "gone"
    assert job_text(JOB) == f"{JOB.identity}  QUEUED     task wave for bench, normal"
    assert job_text(RECORD) == f"{JOB.identity}  CLAIMED    task wave on bench.arm-7"
    cause = Cause("fleet.arm_lost", "gone", hint="look at it")
    lost = replace(RECORD, result=Ending(GoalState.ABORTED, cause.code, "gone", cause=cause))
    assert from_bytes(JobRecord, to_bytes(lost)) == lost
    assert job_text(lost).splitlines()[1:] == ["  gone [fleet.arm_lost]", "  -> look at it"]
    assert job_row(lost)["result"]["code"] == "fleet.arm_lost"
    assert (job_row(JOB)["job"], job_row(JOB)["state"]) == (JOB.identity, "QUEUED")
