"""A TCP proxy whose network a test cuts and mends."""

import socket
import threading
from contextlib import suppress
from typing import Self


class CuttableProxy:
    """Forwards connections to a port of this machine, until they are cut.

    Args:
        target: The port.

    Attributes:
        port: Port on which it listens.
        refused: Set when it has refused a connection.
    """

    def __init__(self, target: int) -> None:
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._whole, self.refused = threading.Event(), threading.Event()
        self._refuses = False
        self._open: set[socket.socket] = set()
        self._whole.set()
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self._listener.close()
        self.cut()
        self._whole.set()

    def cut(self, silent: bool = False) -> None:
        """Cut the network.

        Args:
            silent: True to hold all bytes back; False to end all connections and refuse new ones.
        """
        self._whole.clear()
        self._refuses = not silent
        if not silent:
            self._end(*self._open)

    def mend(self) -> None:
        """Forward again."""
        self._refuses = False
        self._whole.set()

    def _accept(self) -> None:
        with suppress(OSError):  # closed
            while True:
                near, _ = self._listener.accept()
                if self._refuses:
                    near.close()
                    self.refused.set()
                    continue
                far = socket.create_connection(("127.0.0.1", self._target))
                self._open |= {near, far}
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=ends, daemon=True).start()

    def _forward(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                self._whole.wait()
                sink.sendall(data)
        self._end(source, sink)

    def _end(self, *ends: socket.socket) -> None:
        for each in ends:
            self._open.discard(each)
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
