"""Compressed attachments."""

import random
from pathlib import Path

import pytest
import zstandard
from mcap.writer import Writer

from logs import Attachment, Recording, RecordingError, pack
from logs.records.packing import MEDIA_TYPE, unpack

MESH = b"triangle" * 200 + random.Random(1).randbytes(500)


def test_what_is_packed_is_unpacked() -> None:
    packed = pack("m.stl", MESH)
    assert (packed.name, packed.media_type) == ("m.stl.zst", "application/zstd")
    assert len(packed.data) < len(MESH) / 2
    assert unpack(packed) == ("m.stl", MESH)


@pytest.mark.parametrize("data", [b"", b"short", bytes(10**6)])
def test_what_does_not_become_smaller_or_is_nearly_empty_is_not_packed(data: bytes) -> None:
    attachment = Attachment("m.stl", "application/octet-stream", data)
    assert pack("m.stl", data) == attachment
    assert unpack(attachment) == ("m.stl", data)


DAMAGED = {
    "no zstd": b"not packed",
    "cut": zstandard.compress(MESH)[:-9],
    "a bomb": zstandard.compress(bytes(2**24)),
    "without its size": zstandard.ZstdCompressor(write_content_size=False).compress(MESH),
}


@pytest.mark.parametrize("data", DAMAGED.values(), ids=DAMAGED)
def test_what_another_program_packed(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"m\.stl "):
        unpack(Attachment("m.stl.zst", MEDIA_TYPE, data))


def test_a_recording_with_an_attachment_that_cannot_be_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("armtree", {"epoch_ns": "0"})
        writer.add_attachment(0, 0, "m.stl.zst", MEDIA_TYPE, b"not packed")
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(RecordingError, match=r"attachment of another program: m\.stl cannot be"):
        Recording(path).files  # noqa: B018
