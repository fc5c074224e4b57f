"""Our own lock on a serial port, because the kernel's exclusive open is only advisory."""

import contextlib
import fcntl
import os
from pathlib import Path

from .errors import LinkError, PortBusy

# One place for all users and shells, whatever their TMPDIR says.
_FOLDER = Path("/tmp")


class PortLock:
    """A lock file that names its owner and is free again when its owner is gone.

    Args:
        port: The port; two names of one device share a lock.
    """

    def __init__(self, port: str) -> None:
        self._port = port
        self._held: tuple[int, Path] | None = None

    @property
    def path(self) -> Path:
        """The lock file; it is there only while somebody has the lock, or was killed with it."""
        name = os.path.realpath(self._port).strip("/").replace("/", "-")
        return _FOLDER / f"armtree-{name}.lock"

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            PortBusy: Another process has it; names its pid.
            LinkError: The lock file cannot be opened.
        """
        path = self.path
        try:
            file = self._take(path)
        except OSError as error:
            why = f"The lock file {path} cannot be used: {error.strerror}. Remove it"
            raise LinkError(self._port, why) from error
        os.ftruncate(file, 0)
        os.write(file, b"%d\n" % os.getpid())
        self._held = file, path

    def owner(self) -> str | None:
        """Process id of who has the lock; None where nobody has it."""
        try:
            file = os.open(self.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError:
            return None
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return os.read(file, 32).decode("ascii", "replace").strip() or "unknown"
        else:
            return None
        finally:
            os.close(file)

    def release(self) -> None:
        """Give the lock up. Harmless when not taken."""
        if self._held is not None:
            file, path = self._held
            self._held = None
            os.ftruncate(file, 0)
            with contextlib.suppress(OSError):  # another user's, left by one who was killed
                path.unlink()
            os.close(file)

    def _take(self, path: Path) -> int:
        """Open and lock the file; once more where its last owner removed it meanwhile."""
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
    """Open a lock file that every user may take, whoever made it."""
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    try:
        # Not with O_CREAT: Linux refuses that for the file of another user in a shared folder.
        return os.open(path, flags)
    except FileNotFoundError:
        file = os.open(path, flags | os.O_CREAT, 0o666)
        os.fchmod(file, 0o666)  # whatever the umask says
        return file
