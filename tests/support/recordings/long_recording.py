"""A recording of an hour, made from one of seconds: what is between its goal and result repeats."""

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from logs.reading.tolerant_reader import TolerantReader
from logs.writing.compaction import Copy

_TIME = re.compile(rb'("(?:time|scheduled)": ?)(-?[0-9.e-]+)')
_BEFORE, _AFTER = ("/goal", "/robot_description"), ("/result",)
_CHUNK, _GAP = 262_144, 1_000_000  # bytes of a chunk, as armtree writes; between repetitions [ns]


def write_long(source: Path, target: Path, messages: int) -> float:
    """Write a recording with about so many messages; return how long its run takes [s]."""
    from mcap.writer import Writer

    with target.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK, enable_data_crcs=True)
        length, repeated = _repeated(source, messages)
        Copy(writer).all(repeated)
        writer.finish()  # type: ignore[no-untyped-call]
    return length


def _repeated(source: Path, messages: int) -> tuple[float, Iterator[Any]]:
    from mcap.records import Channel, Footer, Message

    records = [each for each in TolerantReader(source) if not isinstance(each, Footer)]
    topics = {each.id: each.topic for each in records if isinstance(each, Channel)}
    parts: dict[bool | None, list[Message]] = {True: [], None: [], False: []}
    for each in records:
        if isinstance(each, Message):
            topic = topics[each.channel_id]
            parts[True if topic in _BEFORE else False if topic in _AFTER else None].append(each)
    body = parts[None]
    times, length = messages // len(body), body[-1].log_time - body[0].log_time + _GAP

    def all_records() -> Iterator[Any]:
        yield from (each for each in records if not isinstance(each, Message))
        yield from parts[True]
        for number in range(times):
            yield from (_later(each, number * length) for each in body)
        yield from (_later(each, (times - 1) * length) for each in parts[False])

    return times * length / 1e9, all_records()


def _later(message: Any, by: int) -> Any:
    """Return a message of a later time [ns], with the times in its JSON."""
    from mcap.records import Message

    def put(found: re.Match[bytes]) -> bytes:
        return found[1] + repr(round(float(found[2]) + by / 1e9, 9)).encode()

    data, time = message.data, message.log_time + by
    if data[8:9] == b"{":  # a text in CDR: four bytes, its length with its zero, and itself
        text = _TIME.sub(put, data[8:-1])
        data = data[:4] + struct.pack("<I", len(text) + 1) + text + b"\0"
    return Message(message.channel_id, time, data, time, message.sequence)
