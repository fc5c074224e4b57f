"""A virtual board in its own process, behind a pseudo-terminal."""

import base64
import os
import pickle
import pty
import subprocess
import sys
import threading
import tty
from typing import Any

from hardware.errors import LinkError, PortLost
from hardware.link.link import VIRTUAL
from hardware.link.serial_link import SerialLink

from .model import BoardModel

_PROGRAM = f"{__package__}.program"


class BoardProcess:
    """The process of a virtual board. A client can open the port at once, before the process runs.

    Args:
        model: Model of the board. The process gets a copy.
        baud: Speed of the line [bit/s]. Bytes at another speed are lost. None accepts any speed.

    Attributes:
        port: Name of the pseudo-terminal.
        pid: Process id.
    """

    def __init__(self, model: BoardModel, baud: int | None = None) -> None:
        master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # The master can detect a client only while no slave is open here.
        os.close(slave)
        board = base64.b64encode(pickle.dumps(model)).decode()
        # The process has its own session, so that Ctrl-C at the terminal does not reach it.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _PROGRAM, str(master), board, str(baud or 0)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=[master],
            start_new_session=True,
        )
        os.close(master)
        self.pid = self._process.pid
        self._closing = threading.Lock()

    def state(self) -> Any:
        """Return the state of the model. Raises the errors of `call`."""
        return self.call("state")

    def call(self, method: str, *arguments: object) -> Any:
        """Call a method of the model with the time and these arguments, and return its result.

        Raises:
            LinkError: The process has ended.
        """
        assert self._process.stdin
        assert self._process.stdout
        asked = base64.b64encode(pickle.dumps((method, arguments))).decode()
        try:
            self._process.stdin.write(f"{asked}\n")
            self._process.stdin.flush()
            return pickle.loads(base64.b64decode(self._process.stdout.readline()))
        except (OSError, ValueError, EOFError):  # a broken or closed pipe, or no answer
            raise LinkError(self.port, "the virtual board has ended; activate again") from None

    def close(self) -> None:
        """End the process, as if the cable were disconnected. Does nothing if it has ended."""
        with self._closing:
            self._process.kill()  # the process has no state to save
            self._process.communicate()


class VirtualLink:
    """A serial link to a virtual board. Opening the link starts the process of the board.

    Args:
        model: The board in its state at power-on.
        baud: Speed of the line [bit/s].

    Attributes:
        board: The process of the board; None while the board is switched off.
    """

    port = VIRTUAL

    def __init__(self, model: BoardModel, baud: int) -> None:
        self._model, self._baud = model, baud
        self.board: BoardProcess | None = None
        self._serial: SerialLink | None = None

    def switch_on(self) -> BoardProcess:
        """Start the process of the board, without waiting for it, and return it.

        The caller can work while the process starts. `close` ends it.
        """
        self.board = self.board or BoardProcess(self._model)
        return self.board

    def open(self) -> None:
        """Switch the board on if necessary, wait for it, and open its port.

        Raises:
            LinkError: The port cannot be opened.
        """
        board = self.switch_on()
        link = SerialLink(board.port, self._baud)
        try:
            board.state()  # wait for its start, so that the boot time begins at the opening
            link.open()
        except LinkError:
            self.close()
            raise
        self._serial = link

    def write(self, data: bytes) -> None:
        """Send bytes. Raises the errors of `SerialLink.write`."""
        link = self._serial
        if link is None:
            raise PortLost(self.port, "The virtual board is not open")
        link.write(data)

    def read(self) -> bytes:
        """Wait for bytes. Raises the errors of `SerialLink.read`."""
        link = self._serial
        return link.read() if link else b""

    @property
    def unread(self) -> bool:
        """True if bytes have arrived that `read` has not returned yet."""
        link = self._serial
        return link is not None and link.unread

    def close(self, discard: bool = False) -> None:
        """Close the port as `SerialLink.close` does, and end the process."""
        link, self._serial = self._serial, None
        board, self.board = self.board, None
        try:
            if link:
                link.close(discard)
        finally:
            if board:
                board.close()
