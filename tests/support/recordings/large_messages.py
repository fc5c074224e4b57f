"""Recordings of less than 1 MB with large messages, each of which is as armtree writes it."""

import json
import random
from collections.abc import Callable
from io import BytesIO
from typing import Any

from mcap.writer import CompressionType, Writer

from logs.records.cdr import Message, encode

_ID = "0" * 32
_MILLION = 1_000_000
_TEXT, _LOG = "std_msgs/msg/String", "rcl_interfaces/msg/Log"
_GOAL = {"time": 1.0, "goal_id": _ID, "task": 1, "name": "", "seed": 1}
_PROGRESS = {"time": 1.0, "goal_id": _ID, "percentage": 1, "phase": "", "node": "", "attempt": 1}
_NODE = {"time": 1.0, "path": "", "name": "", "status": "RUNNING", "message": "", "inputs": {}}
_PLAN = {
    "time": 1.0,
    "group": "arm",
    "joints": ["a"],
    "goal": [0.0],
    "via": [],
    "world": [],
    "velocity_limits": [1.0],
    "acceleration_limits": [1.0],
    "waypoints": [],
    "seed": 1,
    "duration": 1.0,
    "milliseconds": {},
    "code": "",
    "times": [],
    "positions": [],
    "start": {},
    "message": "",
}

# Each is made when it is called: compressing takes a second.
LARGE: dict[str, Callable[[], bytes]] = {
    "phases of 14 MB": lambda: _made("/progress", 25, _PROGRESS, phase="x" * 14 * _MILLION),
    "phases of 1 MB": lambda: _made("/progress", 400, _PROGRESS, phase="x" * _MILLION),
    "lists of 1 MB": lambda: _made("/progress", 300, _PROGRESS, phase=[[]] * 340_000),
    "inputs of 1 MB": lambda: _made("/tree", 400, _NODE, inputs={"x": "x" * _MILLION}),
    "lines of 1 MB": lambda: _made("/rosout", 400, {}, message="x" * _MILLION),
    "goals of 5 MB": lambda: _made("/plan/arm", 3, _PLAN, goal=[1.5] * 1_400_000),
    "errors of 14 MB": lambda: _made("/plan/arm", 25, _PLAN, message="x" * 14 * _MILLION),
    "worlds of 15 MB": lambda: _made("/plan/arm", 25, _PLAN, world=[{}] * 5 * _MILLION),
}


def _made(topic: str, count: int, fields: dict[str, Any], **more: Any) -> bytes:
    """A recording with a goal, and with some messages on a topic."""
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=1 << 18)
    writer.start("ros2", "armtree 0.1.0")
    writer.add_metadata("armtree", {"epoch_ns": "1795000000000000000"})
    # Bytes that allow much to be unpacked after them.
    writer.add_attachment(0, 0, "x", "", random.Random(0).randbytes(400_000))
    type_ = _LOG if topic == "/rosout" else _TEXT
    texts = writer.register_schema(_TEXT, "ros2msg", b"")
    goal = writer.register_channel("/goal", "cdr", texts)
    channel = writer.register_channel(
        topic, "cdr", writer.register_schema(type_, "ros2msg", b"") if type_ != _TEXT else texts
    )
    writer.add_message(goal, 1, _text(_GOAL), 1)
    for number in range(count):
        path = {"path": f"{number}"} if topic == "/tree" else {}
        data = _line(**more) if type_ == _LOG else _text({**fields, **more, **path})
        writer.add_message(channel, 2 + number, data, 2)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def _text(fields: dict[str, Any]) -> bytes:
    return encode(_TEXT, Message(data=json.dumps(fields, separators=(",", ":"))))


def _line(message: str) -> bytes:
    stamp = Message(sec=0, nanosec=0)
    empty = {"name": "", "file": "", "function": "", "line": 0, "level": 20}
    return encode(_LOG, Message(stamp=stamp, msg=message, **empty))
