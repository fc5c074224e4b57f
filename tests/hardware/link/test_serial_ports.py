"""Checks of a port that do not open it."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from hardware import Check, SerialLink, check_port
from hardware.errors import PortMissing
from hardware.link import serial_ports as module
from hardware.link.serial_ports import SerialPort
from tests.support.arms.hardware_rigs import Pty

UNKNOWN_ID = 65534


@pytest.fixture
def line() -> Iterator[Pty]:
    line = Pty()
    yield line
    line.vanish()
    os.close(line.slave)


def reported(port: str) -> Check:
    """The last check of a port."""
    return check_port(port)[-1]


def test_a_port_that_is_there_and_free(line: Pty) -> None:
    checks = check_port(line.port)
    assert [(check.name, check.ok) for check in checks] == [
        ("port", True), ("permission", True), ("ours alone", True),
    ]  # fmt: skip


def test_a_name_that_leads_to_a_port_is_one(line: Pty, tmp_path: Path) -> None:
    (tmp_path / "by-id").symlink_to(line.port)
    assert reported(str(tmp_path / "by-id")).ok


def test_a_port_of_the_computer_itself_is_last_and_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing answers there, and the published sketch never does, so a run would succeed."""
    ports = [ListPortInfo(f"/dev/{name}") for name in ("ttyS0", "ttyUSB0", "ttySC9", "ttyACM0")]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    found = module.serial_ports()
    assert [each.device for each in found] == [
        "/dev/ttyACM0", "/dev/ttySC9", "/dev/ttyUSB0", "/dev/ttyS0",
    ]  # fmt: skip
    assert [each.name for each in found] == ["", "", "", "on-board, probably not the board"]
    with pytest.raises(PortMissing, match=r"ttyUSB0, /dev/ttyS0 \(on-board, probably not the b"):
        SerialLink("/dev/ttyNONE9", 115200).open()


def test_a_missing_port() -> None:
    check = reported("/dev/ttyNONE9")
    assert (check.ok, check.code) == (False, "hw.port_missing")
    assert check.detail == "/dev/ttyNONE9: No such file or directory"


@pytest.mark.parametrize("port", ["/dev/null", "/dev/zero", "/etc/passwd", "/tmp"])
def test_a_path_that_is_no_serial_port(port: str) -> None:
    check = reported(port)
    assert (check.ok, check.code) == (False, "hw.link")
    assert check.detail == f"{port} is not a serial port"


def test_a_terminal_of_the_kernels_is_one() -> None:
    """A real port has an entry in sysfs, as this one does, which exists on every machine."""
    assert check_port("/dev/tty")[0].ok


@pytest.mark.parametrize("usb", ["", "1a86:7523"])
def test_the_error_of_a_denied_port_has_the_group_and_a_udev_rule(
    line: Pty, usb: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "serial_ports", lambda: [SerialPort(line.port, "x", usb, "")])
    os.chmod(line.slave, 0)
    user = os.geteuid()
    if user == 0:  # root ignores the mode
        os.setresuid(UNKNOWN_ID, UNKNOWN_ID, 0)
    try:
        check = check_port(line.port)[1]
    finally:
        os.setresuid(user, user, user)
    assert (check.ok, check.code) == (False, "hw.port_denied")
    assert "sudo usermod -aG " in check.remedy
    assert ('ATTRS{idVendor}=="1a86"' in check.remedy) is bool(usb)
    assert ("udev rule" in check.remedy) is bool(usb)


def test_the_error_of_a_port_of_another_armtree_has_its_process_id(line: Pty) -> None:
    link = SerialLink(line.port, 115200)
    link.open()
    check = reported(line.port)
    assert (check.ok, check.code) == (False, "hw.port_busy")
    assert f"process id {os.getpid()} uses it" in check.detail
    link.close()
    assert reported(line.port).ok


def test_a_lock_of_another_file_system_is_ignored(
    line: Pty, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files of two file systems may have one number."""
    locks, file = tmp_path / "locks", os.stat(line.port)
    monkeypatch.setattr(module, "_LOCKS", locks)
    assert module.owner_of(line.port) is None  # unknown
    owners = []
    for major, minor in [(os.major(file.st_dev), os.minor(file.st_dev)), (0xAB, 0x1)]:
        where = f"{major:02x}:{minor:02x}:{file.st_ino}"
        locks.write_text(f"1: FLOCK  ADVISORY  WRITE 4711 {where} 0 EOF\n")
        owners.append(module.owner_of(line.port))
    assert owners == [4711, None]
