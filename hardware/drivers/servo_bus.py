"""The interface to servos that are asked one by one, by `armtree doctor` and `calibrate`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from hardware.clock import Clock
from hardware.joints import Joint
from hardware.link.link import Link

from .firmware_profile import Firmware


@dataclass(frozen=True, slots=True)
class ServoReport:
    """What a servo says of itself.

    Attributes:
        servo: Its id.
        model: Number of its model.
        firmware: Version of its firmware.
        voltage: Voltage of its supply [V].
        temperature: Its temperature [C].
        position: Where it is [ticks].
        torque: Whether it holds.
        errors: Names of the errors that it reports.
        kept: The values that it keeps without power and that a calibration may change, by name:
            `id`, `baud_rate`, `homing` (its offset), `least` and `most` (its limits) [ticks].
    """

    servo: int
    model: int
    firmware: str
    voltage: float
    temperature: float
    position: int
    torque: bool
    errors: tuple[str, ...]
    kept: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Found:
    """What answered to a search.

    Attributes:
        servos: The servos, by id.
        damaged: Ids whose answers were damaged: two servos may have that id.
        noise: Number of received bytes that belong to no packet.
        strangers: Ids in answers to a request for another id, by the id that was asked.
    """

    servos: Mapping[int, ServoReport] = field(default_factory=dict)
    damaged: frozenset[int] = frozenset()
    noise: int = 0
    strangers: Mapping[int, int] = field(default_factory=dict)


class ServoBus(Protocol):
    """An open port with servos.

    Attributes:
        ticks: Number of positions of a turn.
        turn: Angle of all positions together [deg].
    """

    ticks: int
    turn: float

    def __enter__(self) -> "ServoBus":
        """Open the port. Raises LinkError."""

    def __exit__(self, *raised: object) -> None:
        """Close the port."""

    def find(self, ids: Iterable[int]) -> Found:
        """Ask ids for a report. Raises LinkError."""

    def positions(self, ids: Sequence[int]) -> dict[int, int]:
        """Return the positions of servos by id [ticks], of those that answer."""

    def release(self, ids: Sequence[int]) -> None:
        """Switch the torque of servos off."""

    def keep(self, servo: int, values: Mapping[str, int]) -> None:
        """Write values that a servo keeps, by their names in `ServoReport.kept`; read them back.

        Raises:
            NotKept: It reads back another value, or does not answer.
        """


class ServoDriver(Protocol):
    """What a driver with `Ability.LIMITS` and `Ability.IDENTIFY` has beside `Driver`."""

    def servo_bus(self, firmware: Firmware, link: Link, clock: Clock) -> ServoBus:
        """Return the servos on a link that is not open."""

    def servos(self, joints: Sequence[Joint]) -> dict[str, int]:
        """Return the id of the servo of each joint, by its name."""

    def kept(self, joints: Sequence[Joint]) -> dict[str, dict[str, int]]:
        """Return the values to store in the servo of each joint, as `ServoReport.kept`."""

    def calibrated_wire(
        self, joint: Joint, firmware: Firmware, kept: Mapping[str, int], middle: float
    ) -> str:
        """Return the key `wire` of a calibrated joint, as a table of TOML in one line.

        Args:
            joint: The joint, with its present wire.
            firmware: Firmware of its servo.
            kept: What its servo keeps.
            middle: Position of the joint in the middle between `least` and `most` [rad].
        """
