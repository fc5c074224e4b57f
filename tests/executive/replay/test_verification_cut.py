"""A run that was killed at any time is recovered; what is left holds, and lacks its end."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import logs
from executive.replay.verification import verify
from logs import Recording
from logs.reading.tolerant_reader import TolerantReader
from tests.conftest import Rig, RigMaker

pytestmark = pytest.mark.slow


def begun(rig: Rig, folder: Path) -> bytes:
    """The journal of a real run, at the moment when its tenth frame was sent."""
    found: list[bytes] = []

    def take(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(rig.recorded(logs.Sent)) == 10:
            (path,) = folder.glob("*.mcap")
            found.append(path.read_bytes())

    rig.on_record = take
    (outcome,) = rig.run(1)
    assert outcome.success
    return found[0]


def cuts(path: Path, head: int) -> Iterator[int]:
    """Sizes at which to cut a journal: after each record, and one byte around those of its head."""
    salvage = TolerantReader(path)
    for number, _ in enumerate(salvage):
        beside = number < head
        yield from range(salvage.valid - beside, salvage.valid + beside + 1)


def test_a_run_that_was_cut_anywhere_is_recovered_and_holds(
    rig: RigMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = begun(rig(), tmp_path)
    # 300 recoveries: skip the cost of fsync.
    monkeypatch.setattr("os.fsync", lambda handle: None)
    path = tmp_path / "cut.mcap"
    path.write_bytes(journal)
    frames = 0
    for size in [1, 8, 20, 60, 100, *cuts(path, head=60), len(journal)]:
        path.write_bytes(journal[:size])
        logs.recover(path)
        verification = verify(path)
        found = verification.code, [check.holds for check in verification.checks]
        assert found == ("log.cut", [True, True]), (size, verification.text())
        sent = sum(1 for _ in Recording(path).records(logs.Sent))
        scheduled = any(Recording(path).records(logs.Schedule))
        recorded = any(Recording(path).records())
        nothing = "the recording has no frame" if recorded else "the file was cut before the first"
        words = f"{sent} frame" if scheduled else f"nothing to verify: {nothing}"
        assert verification.checks[0].words.startswith(words)
        frames = max(frames, sent)
    assert frames >= 9  # the tenth may not be written yet
