"""What stands in for a driver where a robot file names none: the arm is planned for, not moved."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from hardware.errors import NoDriver
from hardware.joints import Joint
from hardware.toml_table import TomlTable

from .firmware import Firmware

# Of a robot file that names no driver.
NO_FIRMWARE = Firmware("none", 10.0, 0.0, 0, 0, 0.0, b"")


@dataclass(frozen=True)
class NullDriver:
    """A driver that refuses to drive.

    Attributes:
        path: The robot file that names none.
    """

    path: Path

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """The profile of what is not there."""
        return {NO_FIRMWARE.name: NO_FIRMWARE}

    def wire(self, joint: TomlTable, lower: float, upper: float) -> None:
        """Refuse a `wire`."""
        if "wire" in joint:
            joint.fail("wire", "goes with a driver; write driver and [serial] too, or leave it out")

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Any joints will do."""

    def wire_format(self, joints: Sequence[Joint]) -> NoReturn:
        """Refuse."""
        raise NoDriver(self.path)

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> NoReturn:
        """Refuse."""
        raise NoDriver(self.path)
