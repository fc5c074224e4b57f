"""The serial ports of this machine, looked at without opening any."""

import grp
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from .port_lock import PortLock

_BY_ID = Path("/dev/serial/by-id")


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
        remedy: What to do where it is not so.
    """

    name: str
    ok: bool
    detail: str
    remedy: str = ""


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


def lasting_name(port: str) -> Path | None:
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
        there = stat.S_ISCHR(os.stat(port).st_mode)
    except OSError as error:
        remedy = "plug the board in, or give another --port"
        return Check("port", False, f"{port}: {error.strerror}", remedy)
    if not there:
        return Check("port", False, f"{port} is no device", "give another --port")
    return Check("port", True, f"{port} is there")


def _check_permission(port: str) -> Check:
    if os.access(port, os.R_OK | os.W_OK):
        return Check("permission", True, "this user may read and write it")
    group = group_of(port)
    rule = f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="2341", GROUP="{group}", MODE="0660"'
    remedy = f"type `sudo usermod -aG {group} $USER` and log in again, or add the udev rule {rule}"
    return Check("permission", False, f"{port} belongs to the group {group}", remedy)


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
    return Check("ours alone", False, f"the armtree with process id {owner} has it", remedy)
