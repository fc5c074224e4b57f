"""The records of an MCAP file, up to where it is damaged."""

from collections.abc import Iterator
from pathlib import Path
from stat import S_ISREG
from typing import Any, BinaryIO

from logs.errors import RecordingError
from logs.writing.checksums import MAGIC, is_journal, sound


class Salvage:
    """Iterates over what is valid in a file, finished, live, cut off or damaged.

    Every checksum that the file has is checked. Reading is lazy, a chunk at a time.

    Attributes:
        path: The file.
        intact: After iterating, whether the file was complete and undamaged.
        messages: How many messages were given so far.
        valid: How much of the file the records given so far take, its head included [bytes].
    """

    def __init__(self, path: Path) -> None:
        """Looks at the first bytes only.

        Raises:
            RecordingError: There is no such file, or it never was an MCAP file.
        """
        self.path = path
        self.intact = False
        self.messages = self.valid = 0
        try:
            if not S_ISREG(path.stat().st_mode):  # a pipe would keep whoever opens it waiting
                raise RecordingError(path, "is no file; give a recording, such as *.mcap")
            with path.open("rb") as stream:
                head = stream.read(len(MAGIC))
        except OSError as cause:
            reason = cause.strerror or str(cause)
            raise RecordingError(path, f"cannot be read ({reason}); check the path") from cause
        if not MAGIC.startswith(head):
            raise RecordingError(path, "is not an MCAP file; give a recording, such as *.mcap")

    def __iter__(self) -> Iterator[Any]:
        """Gives the records in file order; ends at the first damage.

        Raises:
            OSError: The disk fails.
        """
        from .validation import Sense, summary_is_whole

        with self.path.open("rb") as stream:
            end = sound(stream) if is_journal(stream) else None
            try:
                sense = Sense()
                for record in self._records(stream):
                    if (end is not None and stream.tell() > end) or not sense.fits(record, stream):
                        return
                    self.messages, self.valid = sense.messages, stream.tell()
                    yield record
                self.intact = sense.data_ended and summary_is_whole(record, stream)
            except OSError:
                raise
            except Exception:
                # Torn or damaged bytes surface as whatever the decoder stumbles over:
                # McapError, struct.error, ValueError, ZstdError, MemoryError and more.
                return
            finally:
                if end is not None and stream.tell() >= end:
                    self.valid = end  # with the check of the last piece

    @property
    def torn(self) -> int:
        """After iterating, how much at the end holds nothing valid [bytes]."""
        return 0 if self.intact else self.path.stat().st_size - self.valid

    def _records(self, stream: BinaryIO) -> Iterator[Any]:
        from mcap.stream_reader import StreamReader

        # A damaged length must not make the reader ask for gigabytes.
        limit = self.path.stat().st_size
        yield from StreamReader(stream, validate_crcs=True, record_size_limit=limit).records
