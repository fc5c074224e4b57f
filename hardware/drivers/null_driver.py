"""The driver of an arm whose robot file names none: it can be planned for but not moved."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from hardware.errors import NoDriver
from hardware.joints import Joint
from hardware.toml_table import TomlTable

from .firmware_profile import Firmware

NO_FIRMWARE = Firmware("none", 10.0, 0.0, 0, 0, 0.0, b"")


@dataclass(frozen=True)
class NullDriver:
    """A driver that refuses to move.

    Attributes:
        path: Path of the robot file.
    """

    path: Path

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """An empty profile, because no firmware is named."""
        return {NO_FIRMWARE.name: NO_FIRMWARE}

    def wire(self, joint: TomlTable, lower: float, upper: float) -> None:
        """Refuse the key `wire`."""
        if "wire" in joint:
            joint.fail("wire", "needs a driver; write driver and [serial] too, or leave it out")

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Accept any joints."""

    def wire_format(self, joints: Sequence[Joint]) -> NoReturn:
        """Raise NoDriver."""
        raise NoDriver(self.path)

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> NoReturn:
        """Raise NoDriver."""
        raise NoDriver(self.path)
