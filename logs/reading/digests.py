"""Digests (short hashes) of a recording: one for every topic, attachment and note.

Compaction writes the digests as a note. They show whether the *content* of a finished recording has
changed, even if another program rewrote the file with valid checksums. Each digest names the part
that it covers. A digest is not a signature: a person who changes a part can also change its digest.
"""

from collections.abc import Iterable, Iterator
from hashlib import blake2b
from itertools import chain
from pathlib import Path
from struct import Struct
from typing import Any

from mcap import records as mcap

from logs.records.file_format import DIGESTS, UNFINISHED

from .tolerant_reader import TolerantReader

_BYTES = 8

_TIMES = Struct("<QQQQ")


class Digests:
    """Computes digests of the MCAP records that pass through `watch`.

    Attributes:
        noted: Digests that the file contains, by name; empty if it contains none.
        journal: True if the file is an unfinished recording (journal), which has no digests yet.
    """

    def __init__(self) -> None:
        self.noted: dict[str, str] = {}
        self.journal = False
        self._digests: dict[str, Any] = {}
        self._types: dict[int, bytes] = {0: b""}
        self._channels: dict[int, tuple[str, bytes]] = {}

    def watch(self, records: Iterable[Any]) -> Iterator[Any]:
        """Yield the records unchanged, and add them to the digests.

        Indexes and statistics belong to no digest.
        """
        for record in records:
            self._add_record(record)
            yield record

    def made(self) -> dict[str, str]:
        """Return the computed digests by name. A name is a topic, `file NAME` or `note NAME`."""
        return {name: digest.hexdigest() for name, digest in self._digests.items()}

    def _add_record(self, record: Any) -> None:
        match record:
            case mcap.Header():
                self.journal = record.library.endswith(UNFINISHED)
            case mcap.Message():
                topic, type_ = self._channels[record.channel_id]
                times = record.log_time, record.publish_time, record.sequence
                self._add(topic, type_, times, record.data)
            case mcap.Schema():
                self._types[record.id] = _joined(record.name, record.encoding, record.data)
            case mcap.Channel():
                facts = _joined(record.message_encoding, *_sorted(record.metadata))
                self._channels[record.id] = record.topic, self._types[record.schema_id] + facts
            case mcap.Attachment():
                times = record.create_time, record.log_time, 0
                self._add(f"file {record.name}", record.media_type.encode(), times, record.data)
            case mcap.Metadata(name=name) if name == DIGESTS:
                self.noted = dict(record.metadata)
            case mcap.Metadata():
                facts = _joined(*_sorted(record.metadata))
                self._add(f"note {record.name}", b"", (0, 0, 0), facts)

    def _add(self, name: str, type_: bytes, times: tuple[int, int, int], data: bytes) -> None:
        if name not in self._digests:
            self._digests[name] = blake2b(type_, digest_size=_BYTES)
        self._digests[name].update(_TIMES.pack(*times, len(data)) + data)


def changed_part(path: Path) -> str:
    """Return the first topic, attachment or note that changed after the recording was finished.

    Returns:
        The name of the part as in `Digests.made`; `note digests` if the file lacks its digests;
        empty if nothing changed, or if the file is a journal.

    Raises:
        RecordingError: The file cannot be read.
    """
    digests = Digests()
    for _ in digests.watch(TolerantReader(path)):
        pass
    made, noted = digests.made(), digests.noted
    if not noted:  # a person who changed the file may have removed its digests
        return "" if digests.journal else f"note {DIGESTS}"
    return next((name for name in chain(noted, made) if made.get(name) != noted.get(name)), "")


def _joined(*parts: str | bytes) -> bytes:
    encoded = (part.encode() if isinstance(part, str) else part for part in parts)
    return b"".join(len(part).to_bytes(4, "little") + part for part in encoded)


def _sorted(facts: dict[str, str]) -> Iterator[str]:
    return chain.from_iterable(sorted(facts.items()))
