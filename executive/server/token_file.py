"""Where a server is found by our own clients, and the token they show it."""

import json
import os
import secrets
import socket
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

PORT = 8765
HTTP_PORT = 80  # clients leave it out

# Of both ends of a connection: a machine that is gone without a word is noticed within 30 s.
KEEPALIVE = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 15),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 5),
    (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 30_000),
)


@dataclass(frozen=True, slots=True)
class ServerInfo:
    """How to reach a server, as it stands in a file that only its user can read.

    Attributes:
        url: Such as http://127.0.0.1:8765.
        token: For whatever changes state.
        pid: Of the server.
    """

    url: str
    token: str
    pid: int

    @property
    def serves(self) -> bool:
        """Whether its process is there."""
        return Path("/proc", str(self.pid)).exists()


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(32)


def file_of(port: int) -> Path:
    """The file of the server on a port."""
    return _folder() / f"server-{port}.json"


def publish(port: int, info: ServerInfo) -> Path:
    """Write the file anew, readable by its user alone; remove those of servers that are gone.

    Raises:
        OSError: It cannot be written, or its folder is not ours alone.
    """
    folder, file = _folder(), file_of(port)
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.stat()
    if found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o077:
        raise PermissionError(f"{folder} belongs to others too; chmod 700 it, or remove it")
    for other in folder.glob("server-*.json"):
        if (left := _read(other)) and not left.serves:
            other.unlink(missing_ok=True)
    handle, name = tempfile.mkstemp(dir=folder)  # made with mode 0600
    with os.fdopen(handle, "w") as stream:
        json.dump({"url": info.url, "token": info.token, "pid": info.pid}, stream)
    os.replace(name, file)
    return file


def withdraw(port: int, info: ServerInfo) -> None:
    """Remove the file, unless another server has written it since."""
    if read(port) == info:
        file_of(port).unlink(missing_ok=True)


def read(port: int) -> ServerInfo | None:
    """What the file of a server says; None where there is none of this user's, or it is gone.

    Whoever listens in the place of a server that was killed shall not be shown its token.
    """
    found = _read(file_of(port))
    return found if found and found.serves else None


def _read(file: Path) -> ServerInfo | None:
    try:
        with file.open() as stream:
            ours = os.fstat(stream.fileno()).st_uid == os.getuid()
            return ServerInfo(**json.load(stream)) if ours else None
    except (OSError, ValueError, TypeError):
        return None


def _folder() -> Path:
    own = os.environ.get("XDG_RUNTIME_DIR")
    return Path(own, "armtree") if own else Path(tempfile.gettempdir(), f"armtree-{os.getuid()}")
