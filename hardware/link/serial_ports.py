"""The serial ports of this machine. This module checks ports without opening them."""

import grp
import os
import re
import stat
from pathlib import Path

from hardware.errors import LinkError, PortBusy, PortDenied, PortMissing
from hardware.loading.dataclass import dataclass

_BY_ID = Path("/dev/serial/by-id")
_LOCKS = Path("/proc/locks")
_ON_BOARD = re.compile("/dev/ttyS[0-9]+")
_ON_BOARD_NAME = "on-board, probably not the board"
_PSEUDO_TERMINALS = range(136, 144)  # major device numbers; sysfs does not list these devices


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port.

    Attributes:
        device: Device, such as `/dev/ttyACM0`.
        name: Product name of the device; empty if it reports no name. For a port of the computer
            itself, a note that it is probably not the board.
        usb: Vendor and product id, such as `2341:0043`; empty if it is not a USB device.
        by_id: Persistent name under `/dev/serial/by-id`; empty if there is none.
    """

    device: str
    name: str
    usb: str
    by_id: str


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check of `armtree doctor`.

    Attributes:
        name: Subject of the check.
        ok: True if the check passed; None if it was not possible, which is not a failure.
        detail: The result in words.
        remedy: Advice after a failure; empty if the detail is enough.
        code: Code of the error that would end a run; empty if the check passed.
        values: The result as plain values, for a report.
    """

    name: str
    ok: bool | None
    detail: str
    remedy: str = ""
    code: str = ""
    values: object = None


def serial_ports() -> list[SerialPort]:
    """Return the serial ports of this machine. Ports of the computer itself come last."""
    from serial.tools import list_ports  # slower to load than the rest of pyserial

    names = {os.path.realpath(link): str(link) for link in _links()}
    ports = [
        SerialPort(
            device=found.device,
            name=_ON_BOARD_NAME if _ON_BOARD.fullmatch(found.device) else found.product or "",
            usb=f"{found.vid:04x}:{found.pid:04x}" if found.vid is not None else "",
            by_id=names.get(os.path.realpath(found.device), ""),
        )
        for found in sorted(list_ports.comports())
    ]
    return sorted(ports, key=lambda port: port.name == _ON_BOARD_NAME)


def persistent_name(port: str) -> Path | None:
    """Return the persistent name of a port, under `/dev/serial/by-id`, or None."""
    device = os.path.realpath(port)
    return next((link for link in _links() if os.path.realpath(link) == device), None)


def check_port(port: str) -> list[Check]:
    """Check whether a port can be opened, without opening it."""
    exists = _check_exists(port)
    return [exists, _check_permission(port), _check_free(port)] if exists.ok else [exists]


def _links() -> list[Path]:
    return list(_BY_ID.iterdir()) if _BY_ID.is_dir() else []


def _check_exists(port: str) -> Check:
    try:
        status = os.stat(port)
    except OSError as error:
        remedy = "plug the board in, or give another --port"
        return Check("port", False, f"{port}: {error.strerror}", remedy, PortMissing.code)
    if not _is_terminal(status):
        remedy = "give another --port"
        return Check("port", False, f"{port} is not a serial port", remedy, LinkError.code)
    on_board = f" ({_ON_BOARD_NAME})" if _ON_BOARD.fullmatch(port) else ""
    return Check("port", True, f"{port} is there{on_board}")


def _is_terminal(status: os.stat_result) -> bool:
    """Return True if a file is a terminal. Serial ports are terminals."""
    if not stat.S_ISCHR(status.st_mode):
        return False
    major, minor = os.major(status.st_rdev), os.minor(status.st_rdev)
    kind = os.path.realpath(f"/sys/dev/char/{major}:{minor}/subsystem")
    return major in _PSEUDO_TERMINALS or os.path.basename(kind) == "tty"


def _check_permission(port: str) -> Check:
    if os.access(port, os.R_OK | os.W_OK):
        return Check("permission", True, "this user may read and write the port")
    group = group_of(port)
    remedy = f"type `sudo usermod -aG {group} $USER` and log in again"
    if vendor := usb_id(port).partition(":")[0]:
        rule = f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", GROUP="{group}", MODE="0660"'
        remedy += f", or add the udev rule {rule}"
    what = f"{port} belongs to the group {group}"
    return Check("permission", False, what, remedy, PortDenied.code)


def usb_id(port: str) -> str:
    """Return vendor and product id of a port, such as `2341:0043`; empty if it has none."""
    device = os.path.realpath(port)
    found = (each.usb for each in serial_ports() if os.path.realpath(each.device) == device)
    return next(found, "")


def group_of(port: str) -> str:
    """Return the name of the group that may use a port; if unknown, `dialout`, as in Debian."""
    try:
        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"


def owner_of(port: str) -> int | None:
    """Return the process id of the program that has locked a port, or None if unknown."""
    try:
        device, locks = os.stat(port), _LOCKS.read_text()
    except OSError:
        return None
    # 3: FLOCK  ADVISORY  WRITE 4711 00:1a:3 0 EOF
    inode = f"{os.major(device.st_dev):02x}:{os.minor(device.st_dev):02x}:{device.st_ino}"
    owner = re.search(rf"FLOCK +ADVISORY +WRITE +(\d+) +{inode} ", locks)
    return int(owner[1]) if owner else None


def _check_free(port: str) -> Check:
    owner = owner_of(port)
    if owner is None:
        return Check("ours alone", True, "no other program has locked the port")
    who = f"the program with process id {owner}"
    return Check("ours alone", False, f"{who} uses it", "end that program", PortBusy.code)
