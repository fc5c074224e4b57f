"""A lock on a serial port, because the exclusive open of the kernel is only advisory."""

import contextlib
import fcntl
import os
import re
from pathlib import Path

from hardware.errors import LinkError, PortBusy

# The same for all users and shells, even if they set TMPDIR.
_FOLDER = Path("/tmp")
_LOCKS = Path("/proc/locks")


class PortLock:
    """A lock file that names its owner. It is released when the process of its owner ends.

    Args:
        port: Name of the port. Two names of one device share a lock.
    """

    def __init__(self, port: str) -> None:
        self._port = port
        self._held: tuple[int, Path] | None = None

    @property
    def path(self) -> Path:
        """The lock file. It exists only while the lock is held, or after its owner was killed."""
        name = os.path.realpath(self._port).strip("/").replace("/", "-")
        return _FOLDER / f"armtree-{name}.lock"

    def acquire(self) -> None:
        """Acquire the lock.

        Raises:
            PortBusy: Another process has it. The message names its process id.
            LinkError: The lock file cannot be opened or written.
        """
        path = self.path
        try:
            file = self._take(path)
            self._held = file, path
            os.ftruncate(file, 0)
            os.write(file, b"%d\n" % os.getpid())
        except OSError as error:
            self.release()
            why = f"The lock file {path} cannot be used: {error.strerror}"
            raise LinkError(self._port, f"{why}. Remove it, or make room there") from error

    def owner(self) -> str | None:
        """Return the process id of the owner, or None if there is none or it is unknown.

        This does not try the lock, because that could make another process fail to acquire it.
        """
        try:
            file = os.lstat(self.path)
            locks = _LOCKS.read_text()
        except OSError:
            return None
        # 3: FLOCK  ADVISORY  WRITE 4711 fe:00:2230596 0 EOF
        inode = f"{os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x}:{file.st_ino}"
        owner = re.search(rf"FLOCK +ADVISORY +WRITE +(\d+) +{inode} ", locks)
        return owner[1] if owner else None

    def release(self) -> None:
        """Release the lock. Does nothing if it is not held."""
        if self._held is not None:
            file, path = self._held
            self._held = None
            with contextlib.suppress(OSError):  # left by a killed process of another user
                os.ftruncate(file, 0)
                path.unlink()
            os.close(file)

    def _take(self, path: Path) -> int:
        """Open and lock the file. Try again if its last owner removed it meanwhile."""
        while True:
            file = _open(path)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                owner = os.read(file, 32).decode("ascii", "replace").strip() or "unknown"
                os.close(file)
                raise PortBusy(self._port, f"the armtree with process id {owner}") from None
            if os.fstat(file).st_nlink:
                return file
            os.close(file)


def _open(path: Path) -> int:
    """Open a lock file that every user may lock, even one that another user created."""
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    try:
        # Without O_CREAT, which Linux refuses for the file of another user in a shared folder.
        return os.open(path, flags)
    except FileNotFoundError:
        file = os.open(path, flags | os.O_CREAT, 0o666)
        os.fchmod(file, 0o666)  # regardless of the umask
        return file
