"""Our own lock on a serial port, because the kernel's exclusive open is only advisory."""

import fcntl
import os
import tempfile
from pathlib import Path

from .errors import PortBusy


class PortLock:
    """A lock file that names its owner and is free again when its owner is gone.

    Args:
        port: The port; two names of one device share a lock.
    """

    def __init__(self, port: str) -> None:
        self._port = port
        name = os.path.realpath(port).strip("/").replace("/", "-")
        self.path = Path(tempfile.gettempdir()) / f"armtree-{name}.lock"
        self._file: int | None = None

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            PortBusy: Another process has it; names its pid.
        """
        file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(file, 32).decode("ascii", "replace").strip() or "unknown"
            os.close(file)
            raise PortBusy(self._port, f"the armtree with process id {owner}") from None
        os.ftruncate(file, 0)
        os.write(file, b"%d\n" % os.getpid())
        self._file = file

    def release(self) -> None:
        """Give the lock up. Harmless when not taken."""
        if self._file is not None:
            os.ftruncate(self._file, 0)
            os.close(self._file)
            self._file = None
