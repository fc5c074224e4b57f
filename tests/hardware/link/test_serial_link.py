"""Serial ports that are missing, denied, busy, lost or stuck, on real pseudo-terminals."""

import itertools
import os
import re
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial

from hardware import LinkError, RealClock, SerialLink
from hardware.errors import PortBusy, PortDenied, PortLost, PortMissing, PortStalled
from hardware.link import serial_link
from hardware.link.serial_ports import owner_of
from tests.support.arms.hardware_rigs import Pty, open_files
from tests.support.paths import ROOT

BAUD = 115200
FRAME = b"b090,s090,e090,g000,"
UNKNOWN_ID = 65534


@pytest.fixture
def line() -> Iterator[Pty]:
    line = Pty()
    yield line
    line.vanish()
    os.close(line.slave)


def refused(port: str, kind: type[LinkError]) -> LinkError:
    before = open_files()
    with pytest.raises(LinkError) as caught:
        SerialLink(port, BAUD).open()
    assert type(caught.value) is kind
    assert caught.value.port == port
    assert open_files() <= before
    return caught.value


def test_a_missing_port() -> None:
    said = str(refused("/dev/ttyNONE9", PortMissing))
    assert re.match("There is no serial port /dev/ttyNONE9; present: .*Plug the board in", said)


def test_an_empty_name_is_no_port() -> None:
    refused("", PortMissing)


def test_a_port_that_is_denied(line: Pty) -> None:
    os.chmod(line.slave, 0)
    root = os.geteuid() == 0
    if root:  # root ignores the mode
        os.seteuid(UNKNOWN_ID)
    try:
        said = str(refused(line.port, PortDenied))
    finally:
        if root:
            os.seteuid(0)
    assert f"No permission to open the port {line.port}" in said
    assert re.search(r"sudo usermod -aG \w+ \$USER", said)


@pytest.mark.parametrize("make", [Path.mkdir, Path.touch])
def test_a_path_that_is_no_serial_port(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / "thing")
    said = str(refused(str(tmp_path / "thing"), LinkError))
    assert f"{tmp_path}/thing cannot be opened as a serial port" in said
    assert "present: " in said


def test_a_busy_port_names_the_owner(line: Pty) -> None:
    first = SerialLink(line.port, BAUD)
    first.open()
    said = str(refused(line.port, PortBusy))
    assert said == (
        f"The port {line.port} is in use by this program, process id {os.getpid()}. Close the arm "
        "on this port. If a write to the port does not return, unplug the board and plug it in "
        "again, then try again"
    )
    first.close()
    second = SerialLink(line.port, BAUD)
    second.open()
    second.close()


def test_another_name_of_a_busy_port_is_busy_too(line: Pty, tmp_path: Path) -> None:
    first = SerialLink(line.port, BAUD)
    first.open()
    (tmp_path / "by-id").symlink_to(line.port)
    refused(str(tmp_path / "by-id"), PortBusy)
    first.close()


def test_a_port_that_another_kind_of_program_has(line: Pty) -> None:
    program = (
        "import serial, sys; port = serial.Serial(sys.argv[1], exclusive=True);"
        "print('open', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, line.port], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout
        assert other.stdout.readline() == b"open\n"
        said = str(refused(line.port, PortBusy))
        assert f"in use by the program with process id {other.pid}." in said
        other.communicate()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become another user")
def test_the_port_of_another_user_is_busy(line: Pty) -> None:
    os.chmod(line.slave, 0o666)
    link = SerialLink(line.port, BAUD)
    link.open()
    os.seteuid(UNKNOWN_ID)
    try:
        said = str(refused(line.port, PortBusy))
    finally:
        os.seteuid(0)
    assert f"process id {os.getpid()}" in said
    link.write(FRAME)  # undisturbed
    assert line.drain() == FRAME
    link.close()


def test_many_threads_open_a_port_one_at_a_time(line: Pty) -> None:
    inside, most, busy = threading.Semaphore(1), list[bool](), list[PortBusy]()

    def compete() -> None:
        for _ in range(50):
            link = SerialLink(line.port, BAUD)
            try:
                link.open()
            except PortBusy as error:
                busy.append(error)
                continue
            most.append(inside.acquire(blocking=False))
            link.write(FRAME)
            inside.release()
            link.close()

    threads = [threading.Thread(target=compete) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(most)
    assert len(most) + len(busy) == 200


def test_a_file_where_others_may_write_does_not_matter(line: Pty, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("data")
    lock = Path("/tmp") / f"armtree-{line.port[1:].replace('/', '-')}.lock"
    lock.unlink(missing_ok=True)
    lock.hardlink_to(precious)
    link = SerialLink(line.port, BAUD)
    link.open()
    link.close()
    lock.unlink()
    assert precious.read_text() == "data"


def test_the_lock_of_a_killed_owner_is_free(line: Pty) -> None:
    program = (
        "import sys; from hardware import SerialLink; link = SerialLink(sys.argv[1], 9600);"
        "link.open(); print('open', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, line.port],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
    ) as other:
        assert other.stdout
        assert other.stdout.readline() == b"open\n"
        assert f"process id {other.pid}." in str(refused(line.port, PortBusy))
        other.kill()
    link = SerialLink(line.port, BAUD)
    link.open()
    link.close()


def test_the_lock_is_given_up_when_the_port_does_not_open(tmp_path: Path) -> None:
    (tmp_path / "thing").touch()
    refused(str(tmp_path / "thing"), LinkError)
    assert owner_of(str(tmp_path / "thing")) is None


def test_the_lock_is_given_up_when_opening_is_interrupted(
    line: Pty, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    link = SerialLink(line.port, BAUD)
    with monkeypatch.context() as patch:
        patch.setattr("hardware.link.serial_link.serial.Serial", interrupt)
        with pytest.raises(KeyboardInterrupt):
            link.open()
    link.close()
    assert owner_of(line.port) is None


def test_bytes_arrive_in_both_directions(line: Pty) -> None:
    link = SerialLink(line.port, BAUD)
    link.open()
    link.write(FRAME)
    assert line.drain() == FRAME
    os.write(line.master, b"hello")
    assert link.read() == b"hello"
    link.close()


def test_bytes_are_unread_until_they_are_read(line: Pty) -> None:
    link = SerialLink(line.port, BAUD)
    assert not link.unread
    link.open()
    os.write(line.master, b"READY")
    while not link.unread:
        pass  # the kernel passes them on
    assert link.read() == b"READY"
    assert not link.unread
    line.vanish()
    assert not link.unread
    link.close()


def test_every_call_reports_a_port_lost_while_idle(line: Pty) -> None:
    link = SerialLink(line.port, BAUD)
    link.open()
    line.vanish()
    with pytest.raises(PortLost, match="Something went wrong while listening"):
        link.read()
    message = f"sending the message {FRAME.decode()} to the port {line.port}: the port"
    with pytest.raises(PortLost, match=f"Something went wrong while {message}"):
        link.write(FRAME)
    link.close()


def test_a_port_lost_while_reading_is_seen_at_once(line: Pty) -> None:
    link, seen = SerialLink(line.port, BAUD), list[float]()
    link.open()

    def listen() -> None:
        with pytest.raises(PortLost):
            link.read()
        seen.append(time.monotonic())

    reader = threading.Thread(target=listen)
    reader.start()
    reader.join(0.02)  # it waits
    assert reader.is_alive()
    lost = time.monotonic()
    line.vanish()
    reader.join(5)
    assert seen[0] - lost < 5
    link.close()


def fill(link: SerialLink) -> tuple[list[bytes], PortStalled]:
    """Writes numbered frames until the line is stuck; returns them and the last exception."""
    frames: list[bytes] = []
    while True:
        frames.append(b"b%03d,s%03d,e000,g000," % divmod(len(frames), 1000))
        try:
            link.write(frames[-1])
        except PortStalled as error:
            return frames, error


def test_a_write_delayed_after_its_end_is_not_stuck(
    line: Pty, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a machine that is busy enough, a second may pass before the writing thread goes on."""
    seconds = itertools.count()
    monkeypatch.setattr(
        serial.serialutil.Timeout, "TIME", staticmethod(lambda: float(next(seconds)))
    )
    link = SerialLink(line.port, BAUD)
    link.open()
    link.write(FRAME)
    link.close()
    assert line.drain() == FRAME


def test_a_port_with_room_is_not_polled(line: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    """A poll of a terminal waits for a thread of the kernel, on a busy machine for 0.3 s."""

    class Poll:
        def register(self, *_: int) -> None: ...

        def poll(self, _: float) -> list[tuple[int, int]]:
            raise AssertionError

    link = SerialLink(line.port, BAUD)
    link.open()
    with monkeypatch.context() as patch:
        patch.setattr(select, "poll", Poll)
        link.write(FRAME)
    link.close()
    assert line.drain() == FRAME


@pytest.mark.parametrize("taken", [0, 1])
def test_a_slow_call_is_not_repeated_after_the_deadline(
    line: Pty, monkeypatch: pytest.MonkeyPatch, taken: int
) -> None:
    """The arm may have been deactivated by then, and nothing may be sent any more."""
    seconds, begins = 0.0, list[float]()

    class Clock(RealClock):
        def now(self) -> float:
            return seconds

    def write(handle: int, data: bytes) -> int:
        nonlocal seconds
        begins.append(seconds)
        seconds += 0.15
        if not taken:
            raise BlockingIOError
        return taken

    link = SerialLink(line.port, BAUD)
    link.open()
    with monkeypatch.context() as patch:
        patch.setattr(serial_link, "RealClock", Clock)
        patch.setattr(os, "write", write)
        with pytest.raises(PortStalled):
            link.write(FRAME)
    link.close()
    assert begins == [0.0, 0.15]


def write_on(link: SerialLink) -> LinkError:
    """Writes until that fails: the kernel moves bytes on by itself, so a stuck line takes more."""
    while True:
        try:
            link.write(FRAME)
        except LinkError as error:
            if not isinstance(error, PortStalled):
                return error


def test_a_stuck_line_is_an_error_and_nothing_is_repeated(line: Pty) -> None:
    link = SerialLink(line.port, BAUD)
    link.open()
    frames, error = fill(link)
    link.close()
    sending = f"sending the message {frames[-1].decode()} to the port {line.port}"
    assert f"{sending}: the port {line.port} accepts no more bytes" in str(error)
    arrived = line.drain()
    assert len(arrived) > 1000
    assert b"".join(frames).startswith(arrived)  # the last one may be cut or missing


@pytest.mark.parametrize("discard", [True, False])
def test_unsent_bytes_in_the_kernel_are_sent_or_discarded(line: Pty, discard: bool) -> None:
    link = SerialLink(line.port, BAUD)
    link.open()
    frames, _ = fill(link)
    link.close(discard)
    arrived = b""
    while select.select([line.master], [], [], 0.2)[0]:  # the kernel moves them up bit by bit
        arrived += line.drain()
    assert b"".join(frames).startswith(arrived)
    there = 4096  # what is at the other end of a pseudo-terminal already
    assert len(arrived) <= there if discard else len(arrived) >= 20 * (len(frames) - 1)


def test_discarding_on_a_port_that_is_gone_is_harmless(line: Pty) -> None:
    link = SerialLink(line.port, BAUD)
    link.open()
    line.vanish()
    link.close(discard=True)
    assert owner_of(line.port) is None


def test_a_port_lost_while_a_write_waits(line: Pty) -> None:
    link = SerialLink(line.port, BAUD)
    link.open()
    fill(link)
    hand = threading.Timer(0.05, line.vanish)
    hand.start()
    assert isinstance(write_on(link), PortLost)
    hand.join()
    link.close()


def test_closing_while_a_write_waits(line: Pty) -> None:
    link, ends = SerialLink(line.port, BAUD), list[LinkError]()
    link.open()
    fill(link)
    writer = threading.Thread(target=lambda: ends.append(write_on(link)))
    writer.start()
    writer.join(0.02)
    link.close()
    writer.join(5)
    assert [type(end) for end in ends] == [PortLost]


def test_a_closing_error_is_no_lost_port_and_frees_everything(line: Pty) -> None:
    link, before = SerialLink(line.port, BAUD), open_files()
    link.open()
    assert link._serial
    assert link._serial.fd is not None
    os.close(link._serial.fd)
    with pytest.raises(LinkError, match=r"Bad file descriptor\. The port is released") as failed:
        link.close()
    assert type(failed.value) is LinkError
    link.close()
    assert open_files() <= before
    assert owner_of(line.port) is None


def test_reading_and_closing_race_without_harm(line: Pty) -> None:
    before = open_files()
    for _ in range(50):
        link = SerialLink(line.port, BAUD)
        link.open()
        threads = [threading.Thread(target=link.read) for _ in range(2)]
        threads += [threading.Thread(target=link.close) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(5)
            assert not thread.is_alive()
    assert open_files() <= before
