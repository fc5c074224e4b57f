"""The end of a file that is being written: whole pieces, or nothing of them."""

import errno
import os
import tempfile
from contextlib import suppress
from io import BufferedWriter
from pathlib import Path
from typing import IO
from weakref import finalize

# Kept free for the end of a run: its last records, and the compaction of a journal of 2 MB.
_RESERVE = 1 << 20  # [bytes]
FULL = (errno.ENOSPC, errno.EDQUOT)


class Tail:
    """Writes to the end of a file at once, whole pieces or nothing of them.

    Attributes:
        full: Whether the disk is full, so that only what was kept free for the end is left.
    """

    def __init__(self, stream: BufferedWriter) -> None:
        """Takes over a new, empty file, and keeps a reserve beside it.

        Args:
            stream: The file; only its descriptor is used.
        """
        self.full = False
        self._stream = stream
        self._written = 0
        self._reserve = _reserve(Path(str(stream.name)).parent)
        if self._reserve:
            finalize(self, self._reserve.close)

    def write(self, data: bytes) -> None:
        """Hand bytes to the operating system. Where the disk is full, the reserve is given up.

        Raises:
            OSError: The disk did not take them; the file ends where it ended before, and is closed.
        """
        try:
            self._write(data)
        except OSError as error:
            if error.errno not in FULL or self._reserve is None:
                self._abandon()
                raise
            self._release()
            self.full = True
            try:
                self._write(data)
            except OSError:
                self._abandon()
                raise

    def close(self) -> None:
        """Bring the file to the disk and close it.

        Raises:
            OSError: The disk failed.
        """
        os.fsync(self._stream.fileno())
        self._stream.close()
        self._release()

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._stream.closed

    def _write(self, data: bytes) -> None:
        handle, done = self._stream.fileno(), 0
        try:
            while done < len(data):
                done += os.write(handle, memoryview(data)[done:])
        except OSError:
            with suppress(OSError):  # the first failure is the one to tell
                os.ftruncate(handle, self._written)
                os.lseek(handle, self._written, os.SEEK_SET)
            raise
        self._written += done

    def _abandon(self) -> None:
        with suppress(OSError):
            self._stream.close()
        self._release()

    def _release(self) -> None:
        reserve, self._reserve = self._reserve, None
        if reserve:
            reserve.close()


def _reserve(folder: Path) -> IO[bytes] | None:
    """Space under a file without a name, which no crash can leave behind; None if there is none."""
    try:
        reserve = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115, closed by who gives it up
    except OSError:
        return None
    try:
        os.posix_fallocate(reserve.fileno(), 0, _RESERVE)
    except OSError:
        reserve.close()
        return None
    return reserve
