"""What pyserial 3.5 really raises on a pseudo-terminal, and what the link makes of each.

Every row brings about one of its errors, first on pyserial alone, so that the table is true, then
under `SerialLink`, which must tell it as one of ours.
"""

import errno
import os
import select
import termios
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import serial
from serial import serialposix

from hardware import LinkError, SerialLink
from hardware.errors import PortBusy, PortDenied, PortLost, PortMissing, PortStalled
from hardware.link.serial_ports import owner_of
from tests.support.arms.hardware_rigs import Pty

FRAME = b"b090,s090,e090,g000,"
UNKNOWN_ID = 65534


class Scene:
    """A pseudo-terminal, and ways to make pyserial fail on it."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        self.line, self.folder, self.patch = Pty(), folder, patch

    def after(self, method: str) -> None:
        """Disconnects the cable right after a method of pyserial's port."""
        original = getattr(serial.Serial, method)

        def then_vanish(port: serial.Serial, *arguments: int) -> object:
            try:
                return original(port, *arguments)
            finally:
                self.line.vanish()

        self.patch.setattr(serial.Serial, method, then_vanish)

    def denied(self) -> str:
        os.chmod(self.line.slave, 0)
        if os.geteuid() == 0:  # root ignores the mode
            os.seteuid(UNKNOWN_ID)
        return self.line.port

    def busy(self) -> str:
        self.other = serial.Serial(self.line.port, exclusive=True)
        return self.line.port

    def no_terminal(self) -> str:
        (self.folder / "file").touch()
        return str(self.folder / "file")

    def lost_while_opening(self) -> str:
        self.after("_update_dtr_state")
        return self.line.port


Port = serial.Serial | SerialLink


def opening(port: Port) -> None:
    port.open()


def reading(port: Port) -> None:
    port.read()


def writing(port: Port) -> None:
    port.write(FRAME)


def filling(port: Port) -> None:
    while True:
        port.write(FRAME)


def reading_all(port: Port) -> None:
    """As the link reads: one byte, then what else is there."""
    if isinstance(port, SerialLink):
        port.read()
    else:
        port.read(1)
        port.read(port.in_waiting)


def gone(scene: Scene, port: Port) -> None:
    scene.line.vanish()


def gone_after_a_byte(scene: Scene, port: Port) -> None:
    os.write(scene.line.master, b"x")
    scene.after("read")


def closed(scene: Scene, port: Port) -> None:
    port.close()


def nothing(scene: Scene, port: Port) -> None:
    """All is well so far."""


@dataclass
class Row:
    """An error of pyserial's.

    Attributes:
        raises: Its type; a subclass is another row.
        number: Its errno.
        ours: What the link makes of it.
        act: What fails.
        first: What happens before, with the port open.
        port: Finds the port, where it is the opening that fails.
    """

    raises: type[Exception]
    number: int | None
    ours: type[LinkError]
    act: Callable[[Port], None] = opening
    first: Callable[[Scene, Port], None] = nothing
    port: Callable[[Scene], str] | None = None


_S = serial.SerialException
ROWS = {
    "missing": Row(_S, errno.ENOENT, PortMissing, port=lambda _: "/dev/ttyNONE9"),
    "denied": Row(_S, errno.EACCES, PortDenied, port=Scene.denied),
    "directory": Row(_S, errno.EISDIR, LinkError, port=lambda scene: str(scene.folder)),
    "no terminal": Row(_S, None, LinkError, port=Scene.no_terminal),
    "busy": Row(_S, errno.EAGAIN, PortBusy, port=Scene.busy),
    "lost while opening": Row(termios.error, None, LinkError, port=Scene.lost_while_opening),
    "lost, read": Row(_S, None, PortLost, reading, gone),
    "lost, write": Row(_S, None, PortLost, writing, gone),
    "lost after a byte": Row(OSError, errno.EIO, PortLost, reading_all, gone_after_a_byte),
    "full": Row(serial.SerialTimeoutException, None, PortStalled, filling),
    "closed": Row(serial.PortNotOpenError, None, PortLost, writing, closed),
}


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    user, scene = os.geteuid(), Scene(tmp_path, monkeypatch)
    yield scene
    os.seteuid(user)
    scene.line.vanish()
    os.close(scene.line.slave)
    if hasattr(scene, "other"):
        scene.other.close()


def prepared(row: Row, scene: Scene, port: Port) -> Port:
    if row.act is not opening:
        port.open()
        row.first(scene, port)
    return port


@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)
def test_the_exceptions_of_pyserial(row: Row, scene: Scene) -> None:
    name = row.port(scene) if row.port else scene.line.port
    port = serial.Serial(None, exclusive=True, write_timeout=0.1)
    port.port = name
    prepared(row, scene, port)
    with pytest.raises(row.raises) as raised:
        row.act(port)
    assert type(raised.value) is row.raises
    assert getattr(raised.value, "errno", None) == row.number
    port.close()


@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)
def test_the_errors_of_the_link(row: Row, scene: Scene) -> None:
    name = row.port(scene) if row.port else scene.line.port
    link = SerialLink(name, 115200)
    prepared(row, scene, link)
    with pytest.raises(LinkError) as raised:
        row.act(link)
    assert type(raised.value) is row.ours
    assert raised.value.code.startswith("hw.")
    assert raised.value.port == name
    link.close()
    os.seteuid(os.getuid())
    if row.ours is not PortBusy:
        assert owner_of(name) is None  # it was released


# What pyserial makes of a close from another thread depends on where it overtakes the reader: these
# two, and a quiet end where the reader sees its pipe close before pyserial has forgotten the pipe.
@pytest.mark.parametrize(
    ("woken", "raises"), [(False, serial.SerialException), (True, TypeError)], ids=["early", "late"]
)
def test_closing_under_a_reader_breaks_pyserial(
    scene: Scene, woken: bool, raises: type[Exception]
) -> None:
    port = serial.Serial(scene.line.port)
    os.write(scene.line.master, b"x")

    def overtaken(*wait: Any) -> Any:
        ready = select.select(*wait) if woken else None
        closer = threading.Thread(target=port.close)
        closer.start()
        closer.join()
        return ready or select.select(*wait)

    scene.patch.setattr(serialposix, "select", SimpleNamespace(select=overtaken, error=OSError))
    with pytest.raises(raises) as raised:
        port.read()
    assert type(raised.value) is raises


def test_closing_under_a_reader_ends_the_links_read(scene: Scene) -> None:
    link, heard = SerialLink(scene.line.port, 115200), list[bytes]()
    link.open()
    reader = threading.Thread(target=lambda: heard.append(link.read()))
    reader.start()
    reader.join(0.05)
    link.close()
    reader.join(5)
    assert heard == [b""]
