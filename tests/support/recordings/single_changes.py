"""Every single change of a recording: of one field of a message, of one file, of one note."""

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from copy import copy
from typing import Any

from logs.records.cdr import Message, decode, encode
from logs.records.file_format import DIGESTS

Changed = tuple[str, Any]  # where it was changed, and what it is then

_HEAD = ("log_time", "publish_time", "sequence")


def single_changes(records: Sequence[Any]) -> Iterator[tuple[str, list[Any]]]:
    """Gives all records with one of them changed or left out, and which; of a topic the middle."""
    for place, (name, other) in _changes(records):
        yield name, [*records[:place], *([other] if other else ()), *records[place + 1 :]]


def _changes(records: Sequence[Any]) -> Iterator[tuple[int, Changed]]:
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    messages = defaultdict[int, list[int]](list)
    for place, record in enumerate(records):
        match type(record).__name__:
            case "Schema":
                schemas[record.id] = record.name
            case "Channel":
                channels[record.id] = record.topic, schemas[record.schema_id]
            case "Message":
                messages[record.channel_id].append(place)
            case "Attachment":
                yield from ((place, change) for change in _of_file(record))
            case "Metadata" if record.name != DIGESTS:
                yield from ((place, change) for change in _of_note(record))
    for channel, places in messages.items():
        place = places[len(places) // 2]
        for change in _of_message(records[place], *channels[channel]):
            yield place, change


def _with(record: Any, **changed: Any) -> Any:
    other = copy(record)
    for name, value in changed.items():
        setattr(other, name, value)
    return other


def _of_file(file: Any) -> Iterator[Changed]:
    name, half = f"file {file.name}", len(file.data) // 2
    flipped = file.data[:half] + bytes([file.data[half] ^ 1]) + file.data[half + 1 :]
    yield f"{name} data", _with(file, data=flipped)
    yield f"{name} name", _with(file, name=f"{file.name}x")
    yield f"{name} time", _with(file, log_time=file.log_time + 1)
    yield f"{name} left out", None


def _of_note(note: Any) -> Iterator[Changed]:
    for fact, value in note.metadata.items():
        changed = note.metadata | {fact: _flipped(value)}
        yield f"note {note.name} {fact}", _with(note, metadata=changed)
    yield f"note {note.name} left out", None


def _of_message(message: Any, topic: str, type_: str) -> Iterator[Changed]:
    for name in _HEAD:
        yield f"{topic} {name}", _with(message, **{name: getattr(message, name) + 1})
    yield f"{topic} left out", None
    for place, value in _of(decode(type_, message.data)):
        data = encode(type_, value)
        if data != message.data:
            yield f"{topic} {place}", _with(message, data=data)


def _of(value: Any) -> Iterator[Changed]:
    """One change of every part of a value; of a list's elements the middle."""
    if isinstance(value, Message):
        for name, part in vars(value).items():
            for place, other in _of(part):
                yield f".{name}{place}", Message(**{**vars(value), name: other})
    elif isinstance(value, dict):
        for name, part in value.items():
            yield from ((f".{name}{place}", value | {name: other}) for place, other in _of(part))
    elif isinstance(value, list | tuple | bytes):
        yield from _of_list(value)
    elif isinstance(value, str) and value.startswith("{"):
        yield from ((place, json.dumps(other)) for place, other in _of(json.loads(value)))
    else:
        yield "", _other(value)


def _of_list(values: Any) -> Iterator[Changed]:
    if not len(values):
        return
    if isinstance(values, list):  # arrays may be of one length always
        yield "[-1] left out", values[:-1]
    middle = len(values) // 2
    parts = [("", values[middle] ^ 1)] if isinstance(values, bytes) else _of(values[middle])
    for place, other in parts:
        yield f"[]{place}", type(values)([*values[:middle], other, *values[middle + 1 :]])


def _other(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return _flipped(value)
    return 1.5 if value is None else value + (1e-3 if isinstance(value, float) else 1)


def _flipped(text: str) -> str:
    return text[:-1] + chr(ord(text[-1]) ^ 1) if text else "x"
