"""The files and commands that make `armtree serve` a service of systemd."""

import pwd
import re
from collections.abc import Iterator
from pathlib import Path

from hardware.loading.dataclass import dataclass

USER = "armtree"
UNIT = Path("/etc/systemd/system/armtree.service")
RULE = Path("/etc/udev/rules.d/90-armtree.rules")
DEVICE = "/dev/armtree"  # name of the port by the udev rule
# Folders that ProtectHome and PrivateTmp hide from the service.
_HIDDEN = ("/home/", "/root/", "/run/user/", "/tmp/", "/var/tmp/")


@dataclass(frozen=True, slots=True)
class NewFile:
    """A file that is written.

    Attributes:
        path: Its path.
        text: Its content.
    """

    path: Path
    text: str

    def __str__(self) -> str:
        return f"# {self.path}\n{self.text}"


@dataclass(frozen=True, slots=True)
class Program:
    """A program that is run.

    Attributes:
        words: Its name and arguments.
    """

    words: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join(self.words)


Step = NewFile | Program


def install_steps(armtree: Path, port: str, usb: str, robot: Path | None) -> Iterator[Step]:
    """Return the steps that install the service, in order.

    Args:
        armtree: The command `armtree`.
        port: Serial port, or `virtual`.
        usb: Vendor and product id of the port's device, such as `2341:0043`. A udev rule then gives
            the port a persistent name. Empty for no rule.
        robot: Robot file, or the name of a shipped robot; None for the shipped Arduinobot.
    """
    try:
        pwd.getpwnam(USER)
    except KeyError:
        yield _program(f"useradd --system --groups dialout {USER}")
    if usb:
        yield NewFile(RULE, udev_rule(usb))
        yield _program("udevadm control --reload")
        yield _program("udevadm trigger --action=add --subsystem-match=tty")
    yield NewFile(UNIT, unit_text(armtree, DEVICE if usb else port, robot))
    yield _program("systemctl daemon-reload")
    yield _program("systemctl enable armtree.service")
    yield _program("systemctl restart armtree.service")  # an earlier version may run


def remove_steps() -> Iterator[Program]:
    """Return the steps that remove the service. Its user, tasks and recordings stay."""
    if UNIT.exists():  # an installation may have failed before
        yield _program("systemctl disable --now armtree.service")
    yield _program(f"rm -f {UNIT} {RULE}")
    yield _program("systemctl daemon-reload")
    yield _program("udevadm control --reload")


def udev_rule(usb: str) -> str:
    """Return the rule that gives the port of a USB device the name `/dev/armtree`."""
    vendor, _, product = usb.partition(":")
    return (
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", '
        'SYMLINK+="armtree", GROUP="dialout", MODE="0660"\n'
    )


def unit_text(armtree: Path, port: str, robot: Path | None = None) -> str:
    """Return the unit of systemd; the arguments are those of `install_steps`."""
    words = [str(armtree), "serve", "--port", port, *(["--robot", str(robot)] if robot else [])]
    return f"""\
[Unit]
Description=armtree, a task executive for small robot arms

[Service]
Type=notify
User={USER}
ExecStart={" ".join(map(_quoted, words))}
WorkingDirectory=/var/lib/armtree
StateDirectory=armtree
RuntimeDirectory=armtree
RuntimeDirectoryMode=0700
Environment=XDG_RUNTIME_DIR=/run/armtree
Restart=on-failure
RestartSec=2
WatchdogSec=30
TimeoutStopSec=10
LimitNICE=-10
LimitNOFILE=1024
NoNewPrivileges=yes
ProtectSystem=strict
ProtectHome=yes
PrivateTmp=yes

[Install]
WantedBy=multi-user.target
"""


def hidden_from_service(path: Path) -> bool:
    """Return True if the service cannot read a path, because its folder is a home or temporary."""
    return str(path.resolve()).startswith(_HIDDEN)


def _quoted(word: str) -> str:
    """Return a word of a command line as systemd.service(5) reads it."""
    if re.fullmatch(r"[\w./:+-]+", word):
        return word
    return '"' + re.sub(r'["\\]', r"\\\g<0>", word).replace("%", "%%").replace("$", "$$") + '"'


def _program(line: str) -> Program:
    return Program(tuple(line.split()))
