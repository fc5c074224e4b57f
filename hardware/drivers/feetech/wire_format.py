"""The wire format: joint positions to one sync write of all goal positions, and back."""

import math
from collections.abc import Mapping, Sequence

from hardware.drivers.board_protocol import Measurement
from hardware.drivers.wire_format import Frame
from hardware.joints import Joint, check_positions
from hardware.loading.dataclass import dataclass

from .packets import sync_write
from .registers import CURRENT_UNIT, Series


@dataclass(frozen=True, slots=True)
class ServoWire:
    """The conversion of one joint: `ticks = middle + sign * (q + offset)`, scaled to ticks.

    Attributes:
        servo: Id of the joint's servo.
        sign: +1 or -1.
        offset: Added to the joint position [rad]. If the sum is 0, the servo is in the middle of
            its turn.
        kept: Values that a calibrated servo must store: its offset and limits [ticks] and its mode,
            by their names in `ServoReport.kept`.
    """

    servo: int
    sign: int
    offset: float
    kept: tuple[tuple[str, int], ...] = ()


class ServoFormat:
    """Converts joint positions to commands for all servos at once, and back.

    Args:
        series: Series of the servos.
        joints: The actuated joints.

    Attributes:
        series: Series of the servos.
        servos: Ids of the servos, by joint.
    """

    def __init__(self, series: Series, joints: Sequence[Joint]) -> None:
        self.series, self._joints = series, tuple(joints)
        self._wires = [joint.wire for joint in joints if isinstance(joint.wire, ServoWire)]
        self._per_radian = series.ticks / math.radians(series.turn)
        self.servos = {
            joint.name: wire.servo for joint, wire in zip(joints, self._wires, strict=True)
        }

    @property
    def kept(self) -> list[tuple[str, str, int]]:
        """Joint, name and value of each value that calibrated servos must store."""
        pairs = zip(self._joints, self._wires, strict=True)
        return [(joint.name, *each) for joint, wire in pairs for each in wire.kept]

    def ticks(self, wire: ServoWire, q: float) -> int:
        """Return the position of a servo for a position of its joint [rad]."""
        return self.series.ticks // 2 + round(wire.sign * (q + wire.offset) * self._per_radian)

    def encode(self, positions: Sequence[float]) -> Frame:
        """Return the frame for joint positions, one per actuated joint [rad].

        Raises:
            BadPosition: A position is missing, not a number, not finite or outside its limits.
        """
        pairs = zip(self._wires, check_positions(self._joints, positions), strict=True)
        return self.frame([self.ticks(wire, q) for wire, q in pairs])

    def frame(self, servos: Sequence[int]) -> Frame:
        """Return the frame for positions of the servos [ticks]."""
        return Frame(tuple(servos), self.command("goal_position", servos))

    def command(self, register: str, values: Sequence[int]) -> bytes:
        """Return the packet that sets a register of all servos, one value per joint."""
        pairs = zip(self._wires, values, strict=True)
        data = {wire.servo: self.series.pack(register, value) for wire, value in pairs}
        return sync_write(self.series.registers[register].address, data)

    def decode(self, frame: Frame) -> tuple[float, ...]:
        """Return the joint positions of a frame, within their limits [rad]."""
        return tuple(
            min(max(self._position(wire, ticks), joint.lower), joint.upper)
            for joint, wire, ticks in zip(self._joints, self._wires, frame.servos, strict=True)
        )

    def measurement(self, values: Mapping[str, Sequence[int]], lost: Sequence[int]) -> Measurement:
        """Return a measurement.

        Args:
            values: Values by the names of the measured registers and of `max_torque`, one per
                joint. The effort is a part of `max_torque`, because a servo pushes no more. A
                series may lack the register `current`.
            lost: Number of lost answers of each servo.
        """
        signs = [wire.sign for wire in self._wires]
        wired = zip(self._wires, values["position"], strict=True)
        loads = zip(signs, values["load"], values["max_torque"], strict=True)
        currents = zip(signs, values.get("current", ()), strict=False)
        return Measurement(
            tuple(self._position(wire, ticks) for wire, ticks in wired),
            tuple(s * v / self._per_radian for s, v in zip(signs, values["speed"], strict=True)),
            tuple(s * min(max(load / max(most, 1), -1.0), 1.0) for s, load, most in loads),
            tuple(map(float, values["temperature"])),
            tuple(volts / 10 for volts in values["voltage"]),
            tuple(s * amps * CURRENT_UNIT for s, amps in currents),
            tuple(map(float, lost)),
        )

    def _position(self, wire: ServoWire, ticks: int) -> float:
        return wire.sign * (ticks - self.series.ticks // 2) / self._per_radian - wire.offset
