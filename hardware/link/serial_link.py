"""A link over a serial port, using pyserial."""

import contextlib
import errno
import os
import select
import termios
import threading

import serial

from hardware.clock import RealClock
from hardware.errors import (
    LinkError,
    PortBusy,
    PortDenied,
    PortLost,
    PortMissing,
    PortStalled,
    host_limit,
)
from hardware.printable import wire_text

from .host_load import or_busy
from .serial_ports import group_of, owner_of, serial_ports

# Longest time for a write [s]. A 20-byte frame takes 2 ms on the wire, so a longer write is stuck.
WRITE_TIMEOUT = 0.2

# pyserial raises SerialException (an OSError), plain OSError, or termios.error, which is neither.
_LOST = (OSError, termios.error)


class SerialLink:
    """A serial port, opened exclusively.

    Args:
        port: Name of the device.
        baud: Speed of the line [bit/s].
    """

    def __init__(self, port: str, baud: int) -> None:
        self.port = port
        self._baud = baud
        self._serial: serial.Serial | None = None
        self._reading, self._writing = threading.Lock(), threading.Lock()

    def check(self) -> None:
        """Check that the port exists and that this user may use it, without opening it.

        Raises:
            LinkError: The port cannot be opened.
        """
        try:
            os.stat(self.port)
        except OSError as error:
            raise _open_error(self.port, error) from error
        if not os.access(self.port, os.R_OK | os.W_OK):
            raise PortDenied(self.port, group_of(self.port))

    def open(self) -> None:
        """Open the port and lock its device. The kernel releases the lock if this process ends.

        Raises:
            LinkError: The port cannot be opened. The message names the port and what to do.
        """
        try:
            self._serial = serial.Serial(self.port, self._baud, exclusive=True)
        except (*_LOST, ValueError) as error:
            raise _open_error(self.port, error) from error

    def write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            PortLost: The port disappeared.
            PortStalled: The other end accepts no more bytes. Some bytes may still arrive.
        """
        what = wire_text(data)
        why = f"Something went wrong while sending the message {what} to the port {self.port}"
        try:
            with self._writing:
                if self._serial is None:
                    raise OSError(errno.EBADF, "the port is not open")
                _send(self._serial.fileno(), data)
        except TimeoutError as error:
            raise PortStalled(self.port, why, or_busy()) from error
        except _LOST as error:
            raise PortLost(self.port, why) from error

    def read(self) -> bytes:
        """Wait for bytes and return them; empty if the link is closed.

        Raises:
            PortLost: The port disappeared.
        """
        with self._reading:
            port = self._serial
            if port is None:
                return b""
            try:
                first: bytes = port.read(1)
                return first + port.read(port.in_waiting) if first else b""
            except _LOST as error:
                raise PortLost(self.port, "Something went wrong while listening") from error

    @property
    def unread(self) -> bool:
        """True if bytes have arrived that `read` has not returned yet."""
        port = self._serial
        with contextlib.suppress(*_LOST, TypeError):  # `read` reports a lost port
            return port is not None and port.in_waiting > 0
        return False

    def close(self, discard: bool = False) -> None:
        """Close the port, which releases its lock. A waiting `read` returns.

        Args:
            discard: True to drop the bytes that the kernel has not sent. False to wait for them up
                to `WRITE_TIMEOUT`; the kernel alone would wait for 30 s.

        Raises:
            LinkError: Closing failed. The port is released nevertheless.
        """
        port, self._serial = self._serial, None
        try:
            if port is not None:
                port.cancel_read()
                # pyserial fails if it is closed during a read or write.
                with self._reading, self._writing:
                    _empty(port, discard)
                    _close(port)
        except _LOST as error:
            raise LinkError(self.port, f"{error}. The port is released nevertheless") from error


def _send(handle: int, data: bytes) -> None:
    """Write all bytes. On a busy machine, `write` of pyserial may time out after a success.

    There is no retry after the deadline, because the arm may be deactivated by then. A poll comes
    only if the port takes no more: for each poll of a terminal, Linux waits for the kernel thread
    that carries the bytes of the other direction, which took 0.3 s on a busy machine (`n_tty_poll`
    in drivers/tty/n_tty.c).
    """
    writable, clock = select.poll(), RealClock()
    writable.register(handle, select.POLLOUT)
    left, patience = memoryview(data), WRITE_TIMEOUT
    until = clock.now() + patience
    while left:
        if patience <= 0:
            raise TimeoutError
        with contextlib.suppress(BlockingIOError):
            left = left[os.write(handle, left) :]
        if left:
            writable.poll(1000 * max(0.0, until - clock.now()))
        patience = until - clock.now()


def _empty(port: serial.Serial, discard: bool) -> None:
    """Wait until the kernel has sent all bytes, then drop the rest. `discard` drops all at once."""
    clock = RealClock()
    until, signal = clock.now() + WRITE_TIMEOUT, clock.signal()
    with contextlib.suppress(*_LOST), signal:  # a port that disappeared has no bytes to send
        while not discard and port.out_waiting:
            signal.wait(clock.now() + 0.002)
            discard = clock.now() >= until
        if discard:
            port.reset_output_buffer()


def _close(port: serial.Serial) -> None:
    try:
        port.close()
    except OSError:
        # The kernel has released the handle and may give its number to another file. Without this
        # line, pyserial would close that file at the garbage collection of the port.
        port.fd = os.open(os.devnull, os.O_RDONLY)
        port.close()
        raise


def _open_error(port: str, error: Exception) -> LinkError:
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return PortMissing(port, _present())
    if number in (errno.EACCES, errno.EPERM):
        return PortDenied(port, group_of(port))
    if number in (errno.EAGAIN, errno.EBUSY):
        return PortBusy(port, owner_of(port))
    if limit := host_limit(error):
        failed = LinkError(port, f"{port} cannot be opened ({error}); {limit.hint}")
        failed.hint = limit.hint
        return failed
    why = f"{port} cannot be opened as a serial port ({error}); present: "
    return LinkError(port, why + (", ".join(_present()) or "none"))


def _present() -> list[str]:
    return [
        " = ".join(filter(None, (port.device, port.by_id)))
        + (f" ({port.name})" if port.name else "")
        for port in serial_ports()
    ]
