"""The driver of an arm with bus servos by Feetech, of the STS or SCS series."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from hardware.clock import Clock
from hardware.drivers.firmware_profile import Ability, Firmware, Words
from hardware.joints import Joint
from hardware.link.link import Link
from hardware.link.serial_link import SerialLink
from hardware.loading.dataclass import dataclass
from hardware.toml_table import TomlTable

from .packets import LAST_ID
from .protocol import BusProtocol
from .registers import BAUDS, KEPT, SCS, STS
from .servo_bus import FeetechBus
from .virtual.bus import Bus
from .virtual.servo import Servo
from .wire_format import ServoFormat, ServoWire

_RATE, _MOST_RATE = 50.0, 100.0  # [Hz]
_LOST_ANSWERS = 5  # lost answers of a servo in a row that are a fault
# Largest total turn by one frame at the default rate [ticks]; six servos at top speed need 408.
_MAX_STEP = 400
_GRAVITY = 0.2  # load of a joint of the model, as a share of the largest torque

_WORDS = Words(
    board="servo bus",
    unit="ticks",
    reset_effect="stays where it is",
    advice_outside="turn the joint inwards by hand, with the power off if it holds; or calibrate "
    "again with `armtree calibrate --robot ROBOT --port PORT`",
)


_KEPT = ("homing", "least", "most", "mode")  # keys of a joint's wire
_SERIES = {series.name: series for series in (STS, SCS)}
FIRMWARES = {
    name: Firmware(
        name,
        rate=_RATE,
        most_rate=_MOST_RATE,
        lost_answers=_LOST_ANSWERS,
        max_step=_MAX_STEP,
        resets=False,
        reports_pose=True,
        abilities=frozenset(Ability),
        bauds=BAUDS,
        words=_WORDS,
    )
    for name in _SERIES
}


@dataclass(frozen=True, slots=True)
class Feetech:
    """The driver of a bus with one servo for each joint.

    The key `firmware` of a robot file names the series of the servos.
    """

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """The series `sts` and `scs`."""
        return FIRMWARES

    def wire(self, joint: TomlTable, lower: float, upper: float) -> ServoWire:
        """Read the servo of a joint from the key `wire` of its table."""
        table = joint.table("wire")
        wire = ServoWire(
            servo=table.integer("id", choices=range(LAST_ID + 1)),
            sign=table.integer("sign", choices=(-1, 1)),
            offset=math.radians(table.number("offset_deg")),
            kept=tuple(
                (key, table.integer(key, choices=range(-4095, 4096)))
                for key in _KEPT
                if key in table
            ),
        )
        table.done()
        return wire

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Check that ids are unique and that no joint passes the seam of its servo."""
        wires, taken = self.wire_format(joints, firmware), dict[int, str]()
        series, table = wires.series, root.table("joints")
        for joint in joints:
            wire = _wire(joint)
            if wire.servo in taken:
                what = f"its servo {wire.servo} is already the servo of {taken[wire.servo]}"
                table.fail(joint.name, what)
            taken[wire.servo] = joint.name
            if joint.unit != "rad":
                table.fail(joint.name, "is prismatic; this driver moves only joints that turn")
            for limit in (joint.lower, joint.upper):
                ticks = wires.ticks(wire, limit) if math.isfinite(limit) else -1
                if not 0 <= ticks < series.ticks:
                    where = f"servo {wire.servo} cannot reach the limit {joint.words(limit)}"
                    turn = f"{series.turn:g} deg, with the middle at {joint.words(-wire.offset)}"
                    table.fail(joint.name, f"{where}: it turns {turn}; change limits in the URDF")

    def wire_format(self, joints: Sequence[Joint], firmware: Firmware) -> ServoFormat:
        """Return the wire format of a series."""
        return ServoFormat(_SERIES[firmware.name], joints)

    def protocol(
        self, joints: Sequence[Joint], firmware: Firmware, robot_file: Path
    ) -> BusProtocol:
        """Return the protocol of a bus with these joints."""
        wires = self.wire_format(joints, firmware)
        return BusProtocol(wires, firmware.lost_answers, firmware.rate, firmware.silent_time)

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> Link:
        """Return a link over a serial port."""
        return SerialLink(port, baud)

    def model(self, joints: Sequence[Joint], firmware: Firmware, baud: int) -> Bus:
        """Return a bus with servos in the start pose."""
        wires = self.wire_format(joints, firmware)
        start = wires.encode([joint.boot for joint in joints]).servos
        pairs = zip(wires.servos.values(), start, strict=True)
        servos = [Servo(wires.series, servo, ticks, _GRAVITY) for servo, ticks in pairs]
        by_joint = dict(zip(wires.servos, servos, strict=True))
        for joint, name, value in wires.kept:
            by_joint[joint].put(KEPT[name], value)
        return Bus(servos, baud)

    def servo_bus(self, firmware: Firmware, link: Link, clock: Clock) -> FeetechBus:
        """Return a bus on a link that is not open, for requests to single servos."""
        return FeetechBus(_SERIES[firmware.name], link, clock)

    def servos(self, joints: Sequence[Joint]) -> dict[str, int]:
        """Return the ids of the servos, by the names of their joints."""
        return {joint.name: _wire(joint).servo for joint in joints}

    def kept(self, joints: Sequence[Joint]) -> dict[str, dict[str, int]]:
        """Return the values that calibrated servos must store, by the names of their joints."""
        return {joint.name: dict(_wire(joint).kept) for joint in joints}

    def calibrated_wire(
        self, joint: Joint, firmware: Firmware, kept: Mapping[str, int], middle: float
    ) -> str:
        """Return the value of the key `wire` of a calibrated joint: a table of TOML in one line."""
        wire, series = _wire(joint), _SERIES[firmware.name]
        ticks = (kept["least"] + kept["most"]) / 2 - series.ticks // 2
        offset = wire.sign * ticks * series.turn / series.ticks - math.degrees(middle)
        values = {"id": kept["id"], "sign": wire.sign, "offset_deg": f"{offset:.3f}"}
        values |= {key: kept[key] for key in _KEPT if key in kept}
        return f"{{ {', '.join(f'{key} = {value}' for key, value in values.items())} }}"


def _wire(joint: Joint) -> ServoWire:
    assert isinstance(joint.wire, ServoWire)
    return joint.wire
