"""The file in which a server leaves its URL and token for clients of the same user.

The NATS server of a fleet leaves another kind of file, which only its clients read.
"""

import json
import os
import re
import socket
import stat
import tempfile
from dataclasses import asdict
from pathlib import Path
from urllib.parse import urlsplit

from hardware.loading.dataclass import dataclass

from .strict_json import parse_object

HTTP_PORT = 80  # clients omit this port
SERVER, FLEET = "server", "fleet"  # kinds of files: of `armtree serve`, of `armtree fleet up`
_MOST = 4096  # largest number of characters to read

# Socket options for both ends of a connection. They notice a lost machine within 30 s.
KEEPALIVE = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 15),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 5),
    (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 30_000),
)


@dataclass(frozen=True, slots=True)
class ServerInfo:
    """URL and token of a server: the content of its file.

    Attributes:
        url: URL at which clients on this machine connect, such as http://127.0.0.1:8765.
        token: Token for every request that changes something.
        pid: Process id of the server.
    """

    url: str
    token: str
    pid: int

    @property
    def is_running(self) -> bool:
        """True if its process exists. A process of another user with this number does not count."""
        try:
            return Path("/proc", str(self.pid)).stat().st_uid == os.getuid()
        except OSError:
            return False


def loopback(url: str) -> str:
    """Return a URL with 127.0.0.1 in place of `localhost`, unless TLS checks this name.

    The name may also mean ::1, and another user's program may listen there.
    """
    parts = urlsplit(url)
    if parts.hostname != "localhost" or parts.scheme in ("https", "tls"):
        return url
    address = re.sub("localhost", "127.0.0.1", parts.netloc, flags=re.IGNORECASE)
    return parts._replace(netloc=address).geturl()


def new_token() -> str:
    """Return a random token of 256 bits."""
    import secrets  # slow to import; only a server needs it

    return secrets.token_urlsafe(32)


def file_of(port: int, kind: str = SERVER) -> Path:
    """Return the path of a server's file, for a kind of server and a port."""
    return runtime_folder() / f"{kind}-{port}.json"


def write(port: int, info: ServerInfo, kind: str = SERVER) -> None:
    """Write a server's file, readable only by this user. Remove the files of servers that ended.

    Raises:
        OSError: The file cannot be written, or other users have access to its folder.
    """
    folder = make_folder()
    for other in folder.glob(f"{kind}-*.json"):
        if (left := _read(other)) and not left.is_running:
            other.unlink(missing_ok=True)
    handle, name = tempfile.mkstemp(dir=folder)  # creates the file with mode 0600
    with os.fdopen(handle, "w") as stream:
        json.dump(asdict(info), stream)
    os.replace(name, file_of(port, kind))


def runtime_folder() -> Path:
    """Return the runtime folder of this user. It may be missing."""
    own = os.environ.get("XDG_RUNTIME_DIR")
    return Path(own, "armtree") if own else Path(tempfile.gettempdir(), f"armtree-{os.getuid()}")


def make_folder() -> Path:
    """Return the runtime folder of this user. Make the folder if it does not exist.

    Raises:
        OSError: The folder cannot be made, or other users have access to it.
    """
    folder = runtime_folder()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.lstat()
    if found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o077:
        raise PermissionError(f"other users have access to {folder}; chmod 700 it, or remove it")
    return folder


def remove(port: int, info: ServerInfo, kind: str = SERVER) -> None:
    """Remove a server's file, unless another server has replaced it."""
    if read(port, kind) == info:
        file_of(port, kind).unlink(missing_ok=True)


def read(port: int, kind: str = SERVER) -> ServerInfo | None:
    """Return the content of the file of a running server of this user, or None.

    The token of a killed server must not be sent to a program that now listens on its port.
    """
    found = _read(file_of(port, kind))
    return found if found and found.is_running else None


def running() -> list[ServerInfo]:
    """Return the running servers of this user, in the order of their files."""
    found = map(_read, sorted(runtime_folder().glob("server-*.json")))
    return [info for info in found if info and info.is_running]


def _read(file: Path) -> ServerInfo | None:
    try:
        # The file may be a pipe.
        handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        with os.fdopen(handle) as stream:
            found = os.fstat(handle)
            is_own = found.st_uid == os.getuid() and stat.S_ISREG(found.st_mode)
            return ServerInfo(**parse_object(stream.read(_MOST))) if is_own else None
    except (OSError, ValueError, TypeError):
        return None
