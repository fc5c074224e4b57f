"""The recorder: takes records from every thread, and writes them in one of its own."""

import errno
import fcntl
import logging
import os
import threading
import time
from collections.abc import Callable
from functools import cache, partial
from io import BufferedWriter
from pathlib import Path
from typing import TYPE_CHECKING, Self

from logs.errors import (
    DISK_FULL,
    DiskFull,
    LogError,
    RecordingExists,
    RecordingIncomplete,
    RecordingNotCreated,
)
from logs.records.records import Item, Sent

from .compaction import Summary, rewrite
from .jobs import Jobs

if TYPE_CHECKING:
    from .compactor import Compactor
    from .journal import Journal

_log = logging.getLogger(__name__)

# What a loss of power may cost at most, in a run whose process goes on.
FSYNC_S = 1.0

# Loading what writes the file takes 0.3 s, and far longer on a busy machine.
_BEGIN_S = 10.0


class Recorder:
    """Records one run into one file, without ever keeping the run waiting.

    `put` is one queue put, from any thread. One thread writes all that is recorded in this process,
    another brings it to the disk. While it runs the file is a locked journal, handed to the
    operating system after every record, a frame that keeps its beat within 1 ms, and brought to
    the disk within `FSYNC_S`; `close` makes the final recording of it.
    """

    def __init__(self, path: Path, epoch_ns: int, on_failure: Callable[[Exception], None]) -> None:
        """Creates the file.

        Args:
            path: The new file; its folder exists.
            epoch_ns: UTC at the zero of the records' clock [ns].
            on_failure: Called once, from the recorder's thread, with the first thing that could
                not be written, or when the disk is full; it must not close the recorder itself.

        Raises:
            RecordingExists: The name is taken.
            RecordingNotCreated: The file cannot be made.
        """
        self.path = path
        self._epoch_ns = epoch_ns
        self._on_failure = on_failure
        self._sent = self._kept = 0
        self._lost = 0
        self._cause: Exception | None = None
        self._closed = False
        self._summary: Summary | None = None
        self._journal: Journal | None = None
        self._begun, self._ended = threading.Event(), threading.Event()
        self._unsynced, self._syncing = False, threading.Lock()
        self._slow = False  # whether the disk was, and that is told
        stream = _create(path)
        self._file = os.dup(stream.fileno())  # holds the lock until the recording is made
        self._jobs, self._syncs = _thread("recorder"), _thread("fsync")
        self._jobs.put(partial(self._begin, stream))

    def put(self, *items: Item) -> None:
        """Records something; never blocks, never raises. Ignored after `close`.

        Args:
            items: One, or what is to be written together; a frame by itself.
        """
        job = partial(self._take, items)
        frame = items[0] if type(items[0]) is Sent else None
        if frame:
            self._sent += 1  # by the streamer alone
        if frame and not frame.hold:
            self._jobs.put_at_beat(job)
        else:
            self._jobs.put(job)

    def caught_up(self, timeout: float) -> bool:
        """Whether every frame that was put is on its way to the disk.

        Costs a comparison where that is so; else waits for it. The first time it waits until the
        file has begun, too.

        Args:
            timeout: How long to wait at most [s].
        """
        begun = self._begun.is_set() or self._begun.wait(_BEGIN_S)
        return (begun and self._kept == self._sent) or self.wait(timeout)

    def wait(self, timeout: float = _BEGIN_S) -> bool:
        """Waits until all that was put so far is on its way to the disk; whether it is.

        Args:
            timeout: How long at most [s].
        """
        mark = threading.Event()
        self._jobs.put(mark.set)
        return mark.wait(timeout)

    def settle(self) -> None:
        """Waits until all that was put so far is on its way to the disk.

        Raises:
            RecordingIncomplete: It is not.
        """
        caught_up = self.wait()
        if cause := self._cause or (None if caught_up else TimeoutError("the disk is too slow")):
            raise RecordingIncomplete(self.path, None, cause)

    def close(self, compactor: "Compactor | None" = None) -> Summary:
        """Writes what is queued, and makes the final recording.

        Args:
            compactor: What makes it; None to do it here.

        Raises:
            DiskFull: The disk is, but nothing is missing from the file.
            RecordingIncomplete: Something is missing from the file, or it stayed a journal.
        """
        if not self._closed:
            self._closed = True
            self._jobs.put(self._ended.set)
            self._ended.wait()
            if self._journal is not None:
                self._finish(self._journal)
            self._summary = self._compact(compactor)
            with self._syncing:
                os.close(self._file)
        if self._cause is not None:
            raise self._error(self._cause) from self._cause
        assert self._summary is not None
        return self._summary

    def __enter__(self) -> Self:
        """The recorder itself."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Closes."""
        self.close()

    def _begin(self, stream: BufferedWriter) -> None:
        try:
            from .journal import Journal  # here, for rosbags and mcap take 0.3 s to import

            self._journal = Journal(stream, self._epoch_ns)
        except Exception as cause:
            stream.close()
            self._fail(cause)
        self._begun.set()

    def _take(self, items: tuple[Item, ...]) -> None:
        if self._ended.is_set():
            return
        journal = self._journal
        if journal is None or not self._write(journal, items):
            self._lost += len(items)
        self._kept += type(items[0]) is Sent
        if journal is not None and journal.closed:
            self._journal = None

    def _write(self, journal: "Journal", items: tuple[Item, ...]) -> bool:
        try:
            journal.write(*items)
        except Exception as cause:
            self._fail(cause)
            return False
        if not self._unsynced:
            self._unsynced = True
            self._syncs.put(partial(self._sync, time.monotonic() + FSYNC_S))
        if journal.full:
            self._fail(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        return True

    def _finish(self, journal: "Journal") -> None:
        try:
            journal.finish()
        except OSError as cause:
            self._fail(cause)

    def _sync(self, due: float) -> None:
        self._ended.wait(due - time.monotonic())
        with self._syncing:
            if self._ended.is_set():
                return
            self._unsynced = False
            try:
                os.fsync(self._file)
            except OSError as cause:
                self._fail(cause)
        self._warn_of(time.monotonic() - due)

    def _warn_of(self, late: float) -> None:
        """Tell, once, that the disk does not keep the rhythm; it holds no frame up."""
        if late > FSYNC_S and not self._slow:
            self._slow = True
            _log.warning(
                "%s: it took %.1f s to bring what was recorded to the disk, so that a loss of "
                "power may cost more than %g s; record to a faster disk",
                self.path,
                late,
                FSYNC_S,
            )

    def _fail(self, cause: Exception) -> None:
        if self._cause is not None:
            return  # told once: log lines may themselves come here as records
        self._cause = cause
        _log.error("%s: cannot record: %s", self.path, cause)
        try:
            self._on_failure(cause)
        except Exception:
            _log.exception("%s: the failure could not be reported", self.path)

    def _error(self, cause: Exception) -> LogError:
        finished = self._summary is not None
        if finished and not self._lost and isinstance(cause, OSError) and cause.errno in DISK_FULL:
            return DiskFull(self.path, whole=True)
        return RecordingIncomplete(self.path, self._lost, cause, finished)

    def _compact(self, compactor: "Compactor | None") -> Summary | None:
        try:
            if compactor:
                return compactor.rewrite(self.path, self._file)
            return rewrite(self.path)
        except (OSError, LogError) as cause:
            self._cause = self._cause or cause
            return None


def _create(path: Path) -> BufferedWriter:
    try:
        stream = open(path, "xb")  # noqa: SIM115, closed by the journal
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX)
    except FileExistsError as cause:
        raise RecordingExists(path) from cause
    except OSError as cause:
        raise RecordingNotCreated(path, cause) from cause
    if not _is_at(path, stream):  # another armtree recovered it before it was locked
        stream.close()
        raise RecordingExists(path)
    return stream


def _is_at(path: Path, stream: BufferedWriter) -> bool:
    try:
        return os.path.samestat(os.fstat(stream.fileno()), path.stat())
    except FileNotFoundError:
        return False


@cache
def _thread(name: str) -> Jobs:
    """One for all recorders, for to start a thread keeps a goal waiting."""
    return Jobs(name)
