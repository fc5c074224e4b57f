"""Reads ordinary files up to a size, replaces files atomically, and finds the user's folder."""

import errno
import os
import stat
from pathlib import Path


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a file.

    A file that is not ordinary is refused without opening it: a pipe or a device may never end, and
    opening a serial port resets its board.

    Args:
        path: The file.
        most: Largest size [bytes].

    Raises:
        OSError: The file cannot be read, is not ordinary, or is too large. `strerror` has the
            cause.
        ValueError: The path is invalid.
    """
    _check_ordinary(os.stat(path), path)
    # A pipe or port may have replaced the file since then.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    with os.fdopen(handle, "rb") as stream:
        _check_ordinary(os.fstat(handle), path)
        data = stream.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EINVAL, f"it is larger than {most} bytes", str(path))
    return data


def user_folder() -> Path:
    """Return the folder for the user's files of armtree. The folder may be missing."""
    own = os.environ.get("XDG_CONFIG_HOME", "")
    folder = own if os.path.isabs(own) else os.path.expanduser("~/.config")
    return Path(folder) / "armtree"


def write_file(path: Path, data: bytes) -> None:
    """Replace the content of a file atomically. A crash leaves the old or the new content.

    Args:
        path: The file. It need not exist. A symbolic link stays, and its target is replaced. A pipe
            or a device is not replaced: the content is written to it.
        data: The new content.

    Raises:
        OSError: The file cannot be written. It is unchanged. `filename` is its path.
    """
    try:
        _write(path.resolve(), data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _write(path: Path, data: bytes) -> None:
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    new = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with new.open("wb") as stream:
            stream.write(data)
            stream.flush()
            if path.exists():
                os.fchmod(stream.fileno(), stat.S_IMODE(path.stat().st_mode))
            os.fsync(stream.fileno())
        os.replace(new, path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise


def _check_ordinary(found: os.stat_result, path: Path) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is not an ordinary file", str(path))
