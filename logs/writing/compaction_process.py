"""A process that compacts recordings, so that compaction does not delay the next task."""

import contextlib
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from functools import cache
from pathlib import Path
from weakref import finalize

from .compaction import Summary, rewrite

_AT_ONCE = 4  # number of parallel compactions; each mostly waits for the disk
_BEHIND = 10  # niceness of the process: compaction has a low priority
_PATH_BYTES, _ANSWER_BYTES = 4096, 65536
_STOPPED = 1.0  # without an answer for this time [s], the process may be stopped: continue it


class CompactionProcess:
    """A child process that compacts recordings. Thread-safe.

    The child starts when the object is created, and again if it dies. It has its own session, so
    Ctrl-C in the terminal does not reach it. When the parent process ends, the socket between them
    closes. The child then finishes its compactions and ends.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._start()

    def rewrite(self, journal: Path, lock: int) -> Summary:
        """Compact a journal as `compaction.rewrite` does.

        If the child process fails, the parent process compacts the journal.

        Args:
            journal: The journal.
            lock: File descriptor that holds the journal's lock. The child process shares it, so the
                journal stays locked until it is compacted, even if the parent process is killed.

        Raises:
            RecordingError: The new file lacks messages. The journal is unchanged.
            OSError: The disk failed or is full. The journal is unchanged.
        """
        ours, theirs = socket.socketpair()
        with ours:
            with theirs:
                self._send(os.fsencode(journal.absolute()), [lock, theirs.fileno()])
            answer = b"".join(iter(lambda: self._receive(ours), b""))
        return pickle.loads(answer) if answer else rewrite(journal)

    @property
    def pid(self) -> int:
        """Process id of the child process."""
        return self._process.pid

    def close(self) -> None:
        """End the child process after its pending compactions."""
        self._end()

    def _receive(self, answers: socket.socket) -> bytes:
        """Return the next bytes of the answer. If they take long, continue a stopped process."""
        answers.settimeout(_STOPPED)
        while True:
            try:
                return answers.recv(_ANSWER_BYTES)
            except TimeoutError:
                self._process.send_signal(signal.SIGCONT)

    def _send(self, message: bytes, descriptors: list[int]) -> None:
        with self._lock:
            try:
                socket.send_fds(self._socket, [message], descriptors)
            except OSError:
                self._end()
                self._start()
                socket.send_fds(self._socket, [message], descriptors)

    def _start(self) -> None:
        self._socket, theirs = socket.socketpair(type=socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", __name__],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                start_new_session=True,
            )
        self._end = finalize(self, _end, self._socket, self._process)


@cache
def shared_process() -> CompactionProcess:
    """Return the one compaction process that the whole program uses."""
    return CompactionProcess()


def _end(requests: socket.socket, process: "subprocess.Popen[bytes]") -> None:
    requests.close()
    process.send_signal(signal.SIGCONT)  # a process that SIGSTOP has stopped would never end
    process.wait()


def _serve(requests: socket.socket) -> None:
    """Answer each request with a pickled Summary, or with no bytes if compaction failed."""
    while True:
        message, descriptors, *_ = socket.recv_fds(requests, _PATH_BYTES, 2)
        if not message:
            return
        lock, answer = descriptors
        with contextlib.suppress(Exception), open(answer, "wb") as stream:
            stream.write(pickle.dumps(rewrite(Path(os.fsdecode(message)))))
        os.close(lock)


def _main() -> None:
    import mcap.reader
    import mcap.writer  # noqa: F401, import now, not with the first recording

    os.nice(_BEHIND - min(0, os.nice(0)))
    requests = socket.socket(fileno=sys.stdin.fileno())
    for _ in range(_AT_ONCE):
        threading.Thread(target=_serve, args=(requests,)).start()


if __name__ == "__main__":
    _main()
