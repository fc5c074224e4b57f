"""The checksums of a journal: recovery keeps no damaged byte."""

import os
import struct
import tempfile
from io import FileIO
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

import logs
from logs import recover
from logs.records.file_format import valid_size
from tests.logs.writing.test_compaction import run_journal
from tests.support.recordings.file_damage import piece_ends


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The journal of a successful run."""
    path = tmp_path_factory.mktemp("journal") / "run.mcap"
    run_journal(path)
    return path


@pytest.mark.parametrize("hole", [b"", struct.pack("<BQ", 0x05, 1 << 40)])
def test_a_hole_ends_a_journal(original: Path, tmp_path: Path, hole: bytes) -> None:
    class Counting(FileIO):
        reads = 0

        def read(self, size: int | None = -1, /) -> bytes:
            self.reads += 1
            return super().read(size) or b""

    sparse = tmp_path / "sparse.mcap"
    sparse.write_bytes(original.read_bytes() + hole)
    os.truncate(sparse, 1 << 41)
    found = []
    for path in (original, sparse):
        with Counting(path) as stream:
            found.append((valid_size(stream), stream.reads))
    (size, reads), (sparse_size, sparse_reads) = found
    assert sparse_size <= size
    assert sparse_reads <= reads + 2
    assert logs.Recording(sparse).messages == logs.Recording(original).messages


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    share=st.floats(0.0, 1.0, exclude_max=True),
    kind=st.sampled_from(("flip", "zeros", "gap", "twice")),
    bit=st.integers(0, 7),
    length=st.integers(1, 200),
)
def test_no_damaged_byte_of_a_journal_is_kept(
    original: Path, share: float, kind: str, bit: int, length: int
) -> None:
    """All recovered messages are before the first damaged byte, and unchanged."""
    journal = original.read_bytes()
    place = 8 + int(share * (len(journal) - 8))
    middle = {
        "flip": bytes([journal[place] ^ 1 << bit]) + journal[place + 1 :],
        "zeros": bytes(len(journal) - place),
        "gap": journal[place + length :],
        "twice": journal[max(0, place - length) :],
    }[kind]
    damaged = journal[:place] + middle
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        path.write_bytes(damaged)
        made = recover(path)
        assert made is not None
        assert damaged == journal or made.torn
        assert (made.damaged is not None) == bool(made.torn)
        kept = [(message.topic, message.time_ns, message.cdr) for message in logs.read(path)]
        wrote = [(message.topic, message.time_ns, message.cdr) for message in logs.read(original)]
        assert kept == wrote[: len(kept)]
        assert len(kept) >= sum(end <= place for end in piece_ends(journal))
