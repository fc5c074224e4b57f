"""Small recordings that claim much: what reads them must need little memory and time."""

import json
import struct
from io import BytesIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from logs.records.ros_types import ros_types

_EMPTY_MESSAGE = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22, 1, 0, 1, 1)
_PRIVATE = struct.pack("<BQ", 0x91, 0)  # a record of an application, of no length
_ZEROS = 300_000_000


def bombs() -> dict[str, bytes]:
    """Recordings by name. Each has the head of one of ours, and a bomb in place of the run."""
    zeros = zstandard.compress(bytes(_ZEROS))
    empty = _EMPTY_MESSAGE * 500_000
    private = _PRIVATE * 20_000
    text = ros_types().make("std_msgs/msg/String", data="[" * 200_000)
    deep = dict.fromkeys(("task.resolved.yaml", "arduinobot.toml"), "[" * 100000)
    return {
        "zeros": _with(_chunk(zeros, _ZEROS)),
        "zeros that claim to be few": _with(_chunk(zeros, 1000)),
        "zeros without size": _with(_chunk(_sizeless(bytes(_ZEROS)), 1 << 40)),
        "zeros in many chunks": _with(_chunk(zstandard.compress(bytes(1 << 24)), 1 << 24) * 18),
        "zeros in lz4": _with(_chunk(lz4.frame.compress(bytes(_ZEROS)), 1000, "lz4")),
        "records of no length": _with(_chunk(zstandard.compress(private), len(private))),
        "records of no length, outside": _with(private),
        "empty messages": _with(_chunk(zstandard.compress(empty), len(empty))),
        "a long record": _with(struct.pack("<BQ", Opcode.MESSAGE, 1 << 62)),
        "a long text": _with(_record(Opcode.METADATA, struct.pack("<I", 0xFFFFFFFF))),
        "a long file": _with(_record(Opcode.ATTACHMENT, bytes(24) + struct.pack("<Q", 1 << 61))),
        "deep JSON": _made({}, ros_types().encode(text)),
        "deep files": _made(deep, None),
    }


def _made(files: dict[str, str], goal: bytes | None) -> bytes:
    """A whole recording with these files, and bytes of a goal."""
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.ZSTD)
    writer.start("ros2", "armtree 0.1.0")
    writer.add_metadata("armtree", {"epoch_ns": "1795000000000000000"})
    robot = {"file": "arduinobot.toml", "urdf": "task.resolved.yaml", "sha256": ""}
    writer.add_metadata("robot", {**robot, "firmware": json.dumps([])})
    for name, text in files.items():
        writer.add_attachment(0, 0, name, "text/plain", text.encode())
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channel = writer.register_channel("/goal", "cdr", schema)
    if goal is not None:
        writer.add_message(channel, 1, goal, 1)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def _with(bomb: bytes) -> bytes:
    """A recording with a channel of number 1, and then the bomb."""
    whole = _made({}, None)
    channels = _record(Opcode.SCHEMA, struct.pack("<HI", 1, 1) + b"x" + bytes(8)) + _record(
        Opcode.CHANNEL, struct.pack("<HHI", 1, 1, 2) + b"/x" + bytes(8)
    )
    end = whole.index(struct.pack("<BQI", Opcode.DATA_END, 4, 0))
    return whole[:end] + channels + bomb + whole[end:]


def _chunk(data: bytes, size: int, compression: str = "zstd") -> bytes:
    name = compression.encode()
    head = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name + struct.pack("<Q", len(data))
    return _record(Opcode.CHUNK, head + data)


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def _sizeless(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(write_content_size=False).compress(data)
