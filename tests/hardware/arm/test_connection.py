"""A connection to a board does nothing after its end."""

import queue
import threading

import pytest

from hardware import ArmEvent, BytesReceived, RealClock, load_robot
from hardware.arm.connection import Connection


class Line:
    """A link from which `read` returns or raises what a test puts."""

    port = "line"
    unread = False

    def __init__(self) -> None:
        self.said = queue.Queue[bytes | Exception]()

    def open(self) -> None: ...

    def write(self, data: bytes) -> None: ...

    def read(self) -> bytes:
        data = self.said.get()
        if isinstance(data, Exception):
            raise data
        return data

    def close(self, discard: bool = False) -> None: ...


class Watch:
    """An observer of a connection, which can be blocked."""

    def __init__(self) -> None:
        self.events: list[ArmEvent] = []
        self.faults: list[BaseException] = []
        self.reported, self.leave = threading.Event(), threading.Event()

    def connect(self, line: Line) -> Connection:
        robot = load_robot()
        reported = self.observe, lambda: True, self.faults.append, lambda: None, lambda _: True
        connection = Connection(robot, robot.boot_pose, line, RealClock(), *reported)
        connection.open()
        return connection

    def observe(self, event: ArmEvent) -> None:
        self.events.append(event)
        self.reported.set()
        self.leave.wait(5)


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Line:
    """Closing a connection does not wait for observers."""
    monkeypatch.setattr("hardware.arm.connection.OBSERVER_TIMEOUT", 0.01)
    return Line()


def ended(connection: Connection) -> bool:
    assert connection._reader
    connection._reader.join(5)
    return not connection._reader.is_alive()


def test_a_closed_connection_does_not_take_bytes_of_the_next_one(line: Line) -> None:
    watch = Watch()
    line.said.put(b"first")
    connection = watch.connect(line)
    assert watch.reported.wait(5)
    connection.close()
    line.said.put(b"for the next")
    watch.leave.set()
    assert ended(connection)
    assert line.said.get_nowait() == b"for the next"
    assert watch.faults == []


@pytest.mark.parametrize("late", [b"late", OSError(5, "I/O")])
def test_bytes_and_errors_after_the_end_are_ignored(line: Line, late: bytes | Exception) -> None:
    watch = Watch()
    connection = watch.connect(line)
    connection.close()
    line.said.put(late)
    assert ended(connection)
    assert (watch.events, watch.faults) == ([], [])


def test_a_read_that_ends_while_the_port_is_open_is_a_fault(line: Line) -> None:
    watch = Watch()
    watch.leave.set()
    line.said.put(b"something")
    line.said.put(b"")
    connection = watch.connect(line)
    assert ended(connection)
    assert [event.data for event in watch.events if isinstance(event, BytesReceived)] == [
        b"something"
    ]
    (fault,) = watch.faults
    assert isinstance(fault, EOFError)
    assert str(fault) == "a read ended while the port line was open"
