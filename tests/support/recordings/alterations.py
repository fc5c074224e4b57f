"""Recordings changed by hand: valid copies that say something else."""

import json
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from logs.records.cdr import decode, encode
from logs.records.file_format import DIGESTS
from logs.writing.compaction import Copy

Change = Callable[[Any], None]


def records_of(path: Path) -> list[Any]:
    """All that is in a recording."""
    with path.open("rb") as source:
        return list(StreamReader(source).records)


def rewritten(path: Path, records: Sequence[Any], digests: bool = False) -> Path:
    """A whole and valid recording of records; with the digests of those before, or without any."""
    with path.open("wb") as target:
        writer = Writer(target, enable_data_crcs=True)
        Copy(writer).all(records)
        for record in records if digests else ():
            if type(record).__name__ == "Metadata" and record.name == DIGESTS:
                writer.add_metadata(DIGESTS, record.metadata)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def altered(path: Path, change: Change, digests: bool = False) -> Path:
    """A whole and valid copy of a recording, with some of its records changed."""
    records = records_of(path)
    for record in records:
        change(record)
    return rewritten(path.with_suffix(".altered.mcap"), records, digests)


def replace(kind: str, old: bytes, new: bytes) -> Change:
    """Replaces the first such bytes that any record of a kind has."""
    done = False

    def change(record: Any) -> None:
        nonlocal done
        if not done and type(record).__name__ == kind and old in record.data:
            record.data, done = record.data.replace(old, new, 1), True

    return change


def lacking(path: Path, *topics: str, after: int = 0) -> Path:
    """A whole and valid copy that lacks all messages of some topics but the first few."""
    count = 0
    channels = {}
    records: list[Any] = []
    for record in records_of(path):
        kind = type(record).__name__
        if kind == "Channel":
            channels[record.id] = record.topic
        elif kind == "Message" and channels[record.channel_id].startswith(topics):
            count += 1
            if count > after:
                continue
        records.append(record)
    return rewritten(path.with_suffix(".lacking.mcap"), records)


def each(topics: Collection[str], change: Change, number: int | None = None) -> Change:
    """Changes the messages of some topics; with a number only that one of each."""
    seen = Counter[str]()
    channels: dict[int, str] = {}

    def change_it(record: Any) -> None:
        if type(record).__name__ == "Channel":
            channels[record.id] = record.topic
        elif type(record).__name__ == "Message" and channels[record.channel_id] in topics:
            topic = channels[record.channel_id]
            seen[topic] += 1
            if number in (None, seen[topic]):
                change(record)

    return change_it


def retold(topic: str, change: Callable[[dict[str, Any]], object], number: int = 1) -> Change:
    """Changes the fields of one message of a topic that carries JSON."""

    def tell(record: Any) -> None:
        text = decode("std_msgs/msg/String", record.data)
        fields = json.loads(text.data)
        change(fields)
        text.data = json.dumps(fields)
        record.data = encode("std_msgs/msg/String", text)

    return each([topic], tell, number)


def moved(number: int, field: str, by: float, stamped: bool) -> Change:
    """Moves a time of one frame [s], and the stamps of its messages too."""
    tell = retold(
        "/serial/timing", lambda reported: reported.update({field: reported[field] + by}), number
    )

    def stamp(record: Any) -> None:
        record.log_time += round(by * 1e9) * stamped

    restamp = each(["/serial/tx", "/serial/timing", "/joint_states"], stamp, number)

    def change(record: Any) -> None:
        tell(record)
        restamp(record)

    return change
