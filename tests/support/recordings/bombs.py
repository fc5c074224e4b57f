"""Small recordings that claim much: what reads them must need little memory and time.

Each has the head of one of ours, and a bomb in place of the run.
"""

import json
import struct
from collections.abc import Callable
from io import BytesIO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from logs.records.cdr import Message, encode

_EMPTY_MESSAGE = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22, 1, 0, 1, 1)
_PRIVATE = struct.pack("<BQ", 0x91, 0)  # a record of an application, of no length
_ZEROS = 300_000_000


# Each is made when it is called: compressing takes a second.
BOMBS: dict[str, Callable[[], bytes]] = {
    "zeros": lambda: _with(_chunk(zstandard.compress(bytes(_ZEROS)), _ZEROS)),
    "zeros that claim to be few": lambda: _with(_chunk(zstandard.compress(bytes(_ZEROS)), 1000)),
    "zeros without size": lambda: _with(_chunk(_sizeless(bytes(_ZEROS)), 1 << 40)),
    "zeros in many chunks": lambda: _with(_chunk(zstandard.compress(bytes(1 << 24)), 1 << 24) * 18),
    "zeros in lz4": lambda: _with(_chunk(lz4.frame.compress(bytes(_ZEROS)), 1000, "lz4")),
    "records of no length": lambda: _with(_packed(_PRIVATE * 20_000)),
    "records of no length, outside": lambda: _with(_PRIVATE * 20_000),
    "empty messages": lambda: _with(_packed(_EMPTY_MESSAGE * 500_000)),
    "a long record": lambda: _with(struct.pack("<BQ", Opcode.MESSAGE, 1 << 62)),
    "a long text": lambda: _with(_record(Opcode.METADATA, struct.pack("<I", 0xFFFFFFFF))),
    "a long file": lambda: _with(
        _record(Opcode.ATTACHMENT, bytes(24) + struct.pack("<Q", 1 << 61))
    ),
    "deep JSON": lambda: _made({}, _text("[" * 200_000)),
    "deep files": lambda: _made(
        dict.fromkeys(("task.resolved.yaml", "arduinobot.toml"), "[" * 100_000), None
    ),
}


def _text(text: str) -> bytes:
    return encode("std_msgs/msg/String", Message(data=text))


def _packed(records: bytes) -> bytes:
    return _chunk(zstandard.compress(records), len(records))


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
