"""What speaks to one kind of board, as a seam: an installed package may bring its own.

A robot file names its driver; it is found among the entry points `armtree.hardware`. Limits,
lifecycle, pace and stop stay in front of every driver, and so does the dialogue with a board that
acknowledges frames: a firmware with a `banner` speaks the protocol of `firmware/README.md`. A board
with another one leaves `banner` empty, and what it says is recorded but not understood.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Protocol

from hardware.joints import Joint
from hardware.link.link import Link
from hardware.toml_table import TomlTable

from .firmware import Firmware

GROUP = "armtree.hardware"


@dataclass(frozen=True, slots=True)
class Frame:
    """One command to all servos.

    Attributes:
        servos: Servo angles in the order of the fields [deg].
        data: The bytes that travel.
    """

    servos: tuple[int, ...]
    data: bytes

    def __str__(self) -> str:
        return self.data.decode()


class WireFormat(Protocol):
    """Joint positions to frames and back."""

    def encode(self, positions: Sequence[float]) -> Frame:
        """The frame for joint positions [rad], one value per actuated joint.

        Raises:
            BadPosition: A value is missing, not a number, not finite or outside its limits.
        """

    def frame(self, servos: Sequence[int]) -> Frame:
        """The frame for servo angles, in the servos' own unit."""

    def parse(self, data: bytes) -> Frame:
        """The frame that these bytes spell.

        Raises:
            ValueError: They are no frame of this robot.
        """

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """The joint positions that a frame stands for [rad], within their limits."""


class Driver(Protocol):
    """The kind of board a robot file names. Made without arguments; equal ones are alike."""

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """What may run on the board, by the names that a robot file gives."""

    def wire(self, joint: TomlTable, lower: float, upper: float) -> object:
        """Read how a joint travels, from the key `wire` of its table.

        Args:
            joint: The table, which refuses wrong values.
            lower: The joint's smallest position [rad].
            upper: Its largest [rad].

        Raises:
            DescriptionError: The table is wrong.
        """

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Refuse actuated joints that the board cannot drive.

        Raises:
            DescriptionError: It cannot.
        """

    def wire_format(self, joints: Sequence[Joint]) -> WireFormat:
        """The wire format of these actuated joints."""

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> Link:
        """The line to a board that drives these joints; `virtual` is a port without hardware."""


def load_driver(root: TomlTable) -> Driver:
    """The driver that a robot file names.

    Raises:
        DescriptionError: There is none of that name, or it cannot be loaded.
    """
    present = {point.name: point for point in entry_points(group=GROUP)}
    name = root.choice("driver", present)
    try:
        driver: Driver = present[name].load()()
    except Exception as error:  # somebody else's code: whatever it raises, the file names it
        root.fail("driver", f"{name} cannot be loaded from {present[name].value}: {error!r}")
    return driver
