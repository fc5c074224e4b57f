"""The serial ports of this machine, looked at without opening any."""

import grp
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from hardware.errors import LinkError, PortBusy, PortDenied, PortMissing

from .port_lock import PortLock

_BY_ID = Path("/dev/serial/by-id")
_PSEUDO_TERMINALS = range(136, 144)  # major numbers, which sysfs does not know


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port.

    Attributes:
        device: Such as `/dev/ttyACM0`.
        name: What it calls itself; empty where it does not.
        usb: Vendor and product, such as `2341:0043`; empty where it is no USB device.
        by_id: A name that stays the same when it is plugged in again; empty where there is none.
    """

    device: str
    name: str
    usb: str
    by_id: str


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that must be so before the arm may become active.

    Attributes:
        name: What.
        ok: Whether it is so.
        detail: What was found.
        remedy: What to do where it is not so; empty where that is clear.
        code: That of the error which a run would end with.
    """

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    code: str = ""


def serial_ports() -> list[SerialPort]:
    """The serial ports there are."""
    from serial.tools import list_ports  # takes longer to load than the rest of pyserial

    names = {os.path.realpath(link): str(link) for link in _links()}
    return [
        SerialPort(
            device=found.device,
            name=found.product or "",
            usb=f"{found.vid:04x}:{found.pid:04x}" if found.vid is not None else "",
            by_id=names.get(os.path.realpath(found.device), ""),
        )
        for found in sorted(list_ports.comports())
    ]


def persistent_name(port: str) -> Path | None:
    """The name of a port that stays when its board is plugged in again; None without one."""
    device = os.path.realpath(port)
    return next((link for link in _links() if os.path.realpath(link) == device), None)


def check_port(port: str) -> list[Check]:
    """Whether a port could be opened, as far as can be told without doing it."""
    there = _check_there(port)
    return [there, _check_permission(port), _check_free(port)] if there.ok else [there]


def _links() -> list[Path]:
    return list(_BY_ID.iterdir()) if _BY_ID.is_dir() else []


def _check_there(port: str) -> Check:
    try:
        status = os.stat(port)
    except OSError as error:
        remedy = "plug the board in, or give another --port"
        return Check("port", False, f"{port}: {error.strerror}", remedy, PortMissing.code)
    if not _is_terminal(status):
        remedy = "give another --port"
        return Check("port", False, f"{port} is no serial port", remedy, LinkError.code)
    return Check("port", True, f"{port} is there")


def _is_terminal(status: os.stat_result) -> bool:
    """Whether a file is a terminal, as serial ports are; the kernel tells without opening it."""
    if not stat.S_ISCHR(status.st_mode):
        return False
    major, minor = os.major(status.st_rdev), os.minor(status.st_rdev)
    kind = os.path.realpath(f"/sys/dev/char/{major}:{minor}/subsystem")
    return major in _PSEUDO_TERMINALS or os.path.basename(kind) == "tty"


def _check_permission(port: str) -> Check:
    if os.access(port, os.R_OK | os.W_OK):
        return Check("permission", True, "this user may read and write it")
    group = group_of(port)
    remedy = f"type `sudo usermod -aG {group} $USER` and log in again"
    if vendor := _vendor(port):
        rule = f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", GROUP="{group}", MODE="0660"'
        remedy += f", or add the udev rule {rule}"
    what = f"{port} belongs to the group {group}"
    return Check("permission", False, what, remedy, PortDenied.code)


def _vendor(port: str) -> str:
    """The USB vendor of a port, such as `2341`; empty where it is no USB device."""
    device = os.path.realpath(port)
    found = (each.usb for each in serial_ports() if os.path.realpath(each.device) == device)
    return next(found, "").partition(":")[0]


def group_of(port: str) -> str:
    """The group that may use a port; what Debian gives serial ports where it cannot be told."""
    try:
        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"


def _check_free(port: str) -> Check:
    owner = PortLock(port).owner()
    if owner is None:
        return Check("ours alone", True, "no other armtree has it")
    remedy = f"end it with Ctrl-C, or `kill {owner}`"
    what = f"the armtree with process id {owner} has it"
    return Check("ours alone", False, what, remedy, PortBusy.code)
