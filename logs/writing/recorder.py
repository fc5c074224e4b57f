"""The recorder: accepts records from any thread, and writes them to a file in another thread."""

import errno
import fcntl
import logging
import os
import threading
import time
from collections.abc import Callable, Iterable
from functools import cache, partial
from io import BufferedWriter
from pathlib import Path
from queue import SimpleQueue
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

if TYPE_CHECKING:
    from .compaction_process import CompactionProcess
    from .journal import Journal

_log = logging.getLogger(__name__)

# Longest time from the write of a record to its sync to the disk [s].
FSYNC_S = 1.0

# Longest time to write the first bytes of a file [s]. The first recorder of a process imports
# libraries for this, which is slow on a busy machine.
_BEGIN_S = 10.0

Job = Callable[[], object]


class Recorder:
    """Records one run into one file, without blocking the run.

    All recorders of a process share two threads: one writes, and one syncs files to the disk.
    During the run, the file is a locked journal. Each record is written to the operating system at
    once, and synced to the disk within `FSYNC_S`. `close` makes the finished recording from the
    journal.
    """

    def __init__(self, path: Path, epoch_ns: int, on_failure: Callable[[Exception], None]) -> None:
        """Create the file.

        Args:
            path: The new file. Its folder must exist.
            epoch_ns: UTC time at time 0 of the records' clock [ns since 1970].
            on_failure: Callback for the first error before `close`, which raises its own; a full
                disk also counts as an error. A thread of the recorder calls it. The callback must
                not close the recorder.

        Raises:
            RecordingExists: A file of that name exists.
            RecordingNotCreated: The operating system refused to create the file.
        """
        self.path = path
        self._epoch_ns = epoch_ns
        self._on_failure = on_failure
        # Numbers of frames and of beginnings (`put_made`) that were put, and that were written. The
        # streamer compares them to see that all are written. To ask the writing thread takes 40 us,
        # or 3 ms if a thread is busy.
        self._sent = self._kept = 0
        self._lost = 0
        self._cause: Exception | None = None
        self._closed = False
        self._summary: Summary | None = None
        self._journal: Journal | None = None
        self._begun, self._ended = threading.Event(), threading.Event()
        self._unsynced, self._syncing = False, threading.Lock()
        self._slow = False  # True if a warning of a slow disk was logged
        stream = _create(path)
        self._file = os.dup(stream.fileno())  # holds the lock until the finished recording is made
        self._jobs, self._syncs = _queue("recorder"), _queue("fsync")
        self._jobs.put(partial(self._begin, stream))

    def put(self, *items: Item) -> None:
        """Queue items for writing. It never blocks or raises, and does nothing after `close`.

        Args:
            items: Items to write as one piece. Only the streamer's thread may put a frame (`Sent`),
                and then without other items.
        """
        if isinstance(items[0], Sent):
            self._sent += 1
        self._jobs.put(partial(self._take, items))

    def put_made(self, make: Callable[[], Iterable[Item]]) -> None:
        """Queue items that take long to make, for writing as one piece. It never blocks or raises.

        Args:
            make: Callback that returns the items; no frame. The writing thread calls it. The caller
                must put these items before the first frame.
        """
        self._sent += 1  # the first frame waits for these items, too
        self._jobs.put(partial(self._make, make))

    @property
    def failed(self) -> bool:
        """True after an error. Items that are put after the error may be lost."""
        return self._cause is not None

    @property
    def begun(self) -> bool:
        """True after the first bytes of the file were written, also if this failed."""
        return self._begun.is_set()

    def caught_up(self, timeout: float) -> bool:
        """Wait until all frames so far were written to the operating system.

        The first call also waits until the first bytes of the file are written.

        Args:
            timeout: Longest time to wait for the frames [s].

        Returns:
            True if all frames were written; False after an error or the timeout.
        """
        begun = self.begun or self._begun.wait(_BEGIN_S)
        if self._cause is not None:
            self._ended.wait(timeout)
            return False
        written = (begun and self._kept == self._sent) or self.wait(timeout)
        return written and self._cause is None  # a write may have failed meanwhile

    def wait(self, timeout: float = _BEGIN_S) -> bool:
        """Wait until all items so far were written to the operating system.

        Args:
            timeout: Longest time to wait [s].

        Returns:
            True if all items were written or lost; False if the timeout expired.
        """
        mark = threading.Event()
        self._jobs.put(mark.set)
        return mark.wait(timeout)

    def write_time(self) -> float:
        """Return the total duration of writes since the last call of this method [s].

        An unfinished write counts up to now.
        """
        journal = self._journal
        return journal.write_time() if journal else 0.0

    def flush(self) -> None:
        """Wait until all items so far were written to the operating system.

        Raises:
            RecordingIncomplete: An item could not be written, or the disk is too slow.
        """
        caught_up = self.wait()
        if cause := self._cause or (None if caught_up else TimeoutError("the disk is too slow")):
            raise RecordingIncomplete(self.path, None, cause)

    def close(self, compaction: "CompactionProcess | None" = None) -> Summary:
        """Write the queued items, and make the finished recording.

        Args:
            compaction: Process that makes the finished recording; None for this process.

        Returns:
            A summary of the finished recording.

        Raises:
            DiskFull: The disk is full, but no record is missing from the file.
            RecordingIncomplete: Records are missing from the file, or the file is still a journal.
        """
        if not self._closed:
            self._closed = True
            self._jobs.put(self._ended.set)
            self._ended.wait()
            if self._journal is not None:
                self._finish(self._journal)
            self._summary = self._compact(compaction)
            with self._syncing:
                if self._summary is None and not os.fstat(self._file).st_size:
                    self.path.unlink(missing_ok=True)  # an empty file is not a recording
                os.close(self._file)
        if self._cause is not None:
            raise self._error(self._cause) from self._cause
        assert self._summary is not None
        return self._summary

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Close the recorder."""
        self.close()

    def _begin(self, stream: BufferedWriter) -> None:
        try:
            from .journal import Journal  # here, because mcap is slow to import

            self._journal = Journal(stream, self._epoch_ns)
        except Exception as cause:
            stream.close()
            self._fail(cause)
        self._begun.set()

    def _make(self, make: Callable[[], Iterable[Item]]) -> None:
        if self._ended.is_set():
            return
        try:
            items = tuple(make())
        except Exception as cause:  # all recorders share this thread, so it must not end
            self._lost += 1
            self._fail(cause)
        else:
            if items:
                self._take(items)
        self._kept += 1

    def _take(self, items: tuple[Item, ...]) -> None:
        if self._ended.is_set():
            return
        journal = self._journal
        if journal is None or not self._write(journal, items):
            self._lost += len(items)
        self._kept += isinstance(items[0], Sent)
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
            self._unsynced, begin = False, time.monotonic()
            try:
                os.fsync(self._file)
                # A file without links was deleted. At the end, the finished recording replaces it.
                if not os.fstat(self._file).st_nlink and not self._ended.is_set():
                    raise FileNotFoundError(errno.ENOENT, "it was deleted", str(self.path))
            except OSError as cause:
                self._fail(cause)
        self._warn_of(time.monotonic() - begin)

    def _warn_of(self, duration: float) -> None:
        """Log a warning once if a sync took long. The stream of frames does not wait for a sync.

        Args:
            duration: Duration of the sync [s].
        """
        if duration > FSYNC_S and not self._slow:
            self._slow = True
            _log.warning(
                "%s: it took %.1f s to sync the recording to the disk, so a loss of power may "
                "lose more than %g s; record to a faster disk",
                self.path,
                duration,
                FSYNC_S,
            )

    def _fail(self, cause: Exception) -> None:
        if self._cause is not None:
            return  # report only once, because log lines are recorded here too
        self._cause = cause
        _log.error("%s: cannot record: %s", self.path, cause)
        if self._closed:
            return
        try:
            self._on_failure(cause)
        except Exception:
            _log.exception("%s: the failure could not be reported", self.path)

    def _error(self, cause: Exception) -> LogError:
        finished = self._summary is not None
        if finished and not self._lost and isinstance(cause, OSError) and cause.errno in DISK_FULL:
            return DiskFull(self.path, whole=True)
        return RecordingIncomplete(self.path, self._lost, cause, finished)

    def _compact(self, compaction: "CompactionProcess | None") -> Summary | None:
        try:
            if compaction:
                return compaction.rewrite(self.path, self._file)
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
    if not _is_at(path, stream):  # another armtree recovered the file before it was locked
        stream.close()
        raise RecordingExists(path)
    return stream


def _is_at(path: Path, stream: BufferedWriter) -> bool:
    try:
        return os.path.samestat(os.fstat(stream.fileno()), path.stat())
    except FileNotFoundError:
        return False


@cache
def _queue(name: str) -> SimpleQueue[Job]:
    """Return the job queue of a thread that all recorders share. A new thread would delay a goal.

    Args:
        name: Name of the thread. The first call with a name starts the thread.
    """
    jobs = SimpleQueue[Job]()

    def work() -> None:
        while True:
            jobs.get()()

    # A daemon thread does not delay the end of the process. Without `close`, the file stays a
    # journal, which can be recovered.
    threading.Thread(target=work, name=name, daemon=True).start()
    return jobs
