"""The interface for requests to single servos, for `armtree doctor` and `calibrate`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from typing import Protocol

from hardware.clock import Clock
from hardware.joints import Joint
from hardware.link.link import Link
from hardware.loading.dataclass import dataclass

from .firmware_profile import Firmware

POSITION_MODE = 0  # mode of a servo that moves to positions


@dataclass(frozen=True, slots=True)
class ServoReport:
    """The report of a servo.

    Attributes:
        servo: Id of the servo.
        model: Number of the model.
        firmware: Version of the firmware.
        voltage: Supply voltage [V].
        temperature: Temperature of the servo [C].
        position: Position [ticks].
        torque: True if the servo has torque.
        errors: Names of the reported errors.
        kept: Values that the servo stores without power and that a calibration may change, by name:
            `id`, `baud_rate`, `homing` (offset that is subtracted from the position), `least` and
            `most` (limits) [ticks], `mode` (`POSITION_MODE` if the servo moves to positions).
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
    """The result of a search for servos.

    Attributes:
        servos: Reports of the servos that answered, by id.
        damaged: Ids with damaged answers: two servos may have the same id.
        noise: Number of received bytes outside of packets.
        strangers: Wrong ids in answers, by the requested id.
    """

    servos: Mapping[int, ServoReport] = field(default_factory=dict)
    damaged: frozenset[int] = frozenset()
    noise: int = 0
    strangers: Mapping[int, int] = field(default_factory=dict)


class ServoBus(Protocol):
    """An open port with servos.

    Attributes:
        ticks: Number of positions in a turn.
        turn: Angle of all positions together [deg].
    """

    ticks: int
    turn: float

    def __enter__(self) -> "ServoBus":
        """Open the port. Raises LinkError if this fails."""

    def __exit__(self, *raised: object) -> None:
        """Close the port."""

    def find(self, ids: Iterable[int]) -> Found:
        """Return the reports of the servos with these ids. Raises LinkError if the port fails."""

    def positions(self, ids: Sequence[int]) -> dict[int, int]:
        """Return the positions of the servos that answer [ticks], by id."""

    def release(self, ids: Sequence[int]) -> None:
        """Switch the torque of servos off, and check this.

        Raises:
            NotReleased: A servo still has torque, or does not answer.
        """

    def keep(self, servo: int, values: Mapping[str, int]) -> None:
        """Write stored values of a servo, by their names in `ServoReport.kept`, and check them.

        Raises:
            NotKept: The servo reads back another value, or does not answer.
        """


class ServoDriver(Protocol):
    """The additional methods of a driver with `Ability.LIMITS` and `Ability.IDENTIFY`."""

    def servo_bus(self, firmware: Firmware, link: Link, clock: Clock) -> ServoBus:
        """Return a bus on a link that is not open, for requests to single servos."""

    def servos(self, joints: Sequence[Joint]) -> dict[str, int]:
        """Return the ids of the servos, by the names of their joints."""

    def kept(self, joints: Sequence[Joint]) -> dict[str, dict[str, int]]:
        """Return the values that calibrated servos must store, by the names of their joints."""

    def calibrated_wire(
        self, joint: Joint, firmware: Firmware, kept: Mapping[str, int], middle: float
    ) -> str:
        """Return the value of the key `wire` of a calibrated joint: a table of TOML in one line.

        Args:
            joint: The joint, with its present `wire`.
            firmware: Firmware of the servo.
            kept: Values that its servo stores, by their names in `ServoReport.kept`.
            middle: Position of the joint in the middle between `least` and `most` [rad].
        """
