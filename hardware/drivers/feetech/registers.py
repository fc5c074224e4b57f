"""The memory tables of the STS and SCS series, as data.

Source: Feetech, "Magnetic encoder STS servo: memory table" and "Potentiometer SCSCL servo: memory
table", in the English copies at wiki.aifitlab.com and wiki.juxitech.com (read 2026-11). Addresses
and sizes equal those of the maker's SDK (`feetech-servo-sdk` 1.0.0) and of `st3215` 0.4.2.
LeRobot's `motors/feetech` asks the servos of the SCS series one by one, because they do not know
SYNC READ. Nothing here was checked with a real servo.
"""

from hardware.loading.dataclass import dataclass

MEMORY = 87  # size of a servo's memory [bytes]


@dataclass(frozen=True, slots=True)
class Register:
    """A value in the memory of a servo.

    Attributes:
        address: First address of the value.
        size: Number of bytes of the value, 1 or 2.
        sign: Number of the sign bit, or None if the value has no sign. The other bits are the
            magnitude.
        initial: Factory value.
        kept: True if the value survives without power.
    """

    address: int
    size: int = 1
    sign: int | None = None
    initial: int = 0
    kept: bool = False


@dataclass(frozen=True, slots=True)
class Series:
    """A series of servos.

    Attributes:
        name: Name of the series.
        big_endian: True if the high byte of a value comes first.
        sync_read: True if one request can read from several servos.
        ticks: Number of positions.
        turn: Angle of all positions together [deg].
        registers: The registers by name. Positions are in ticks, loads in 0.1 % of the largest
            torque, voltages in 0.1 V, temperatures in degrees Celsius, currents in 6.5 mA.
    """

    name: str
    big_endian: bool
    sync_read: bool
    ticks: int
    turn: float
    registers: dict[str, Register]

    @property
    def blocks(self) -> tuple[tuple[int, int], ...]:
        """First address and length [bytes] of three parts of the memory.

        The first part survives without power. The second part begins with the torque. The third
        part is the end of the second one. It has the measured values, and each cycle reads it.
        """
        first = [self.registers[name].address for name in ("torque_enable", "position")]
        last = self.registers["current" if "current" in self.registers else "temperature"]
        end = last.address + last.size
        return (0, first[0]), (first[0], end - first[0]), (first[1], end - first[1])

    def pack(self, name: str, value: int) -> bytes:
        """Return the bytes of a value of a register.

        Raises:
            OverflowError: The value does not fit into the register.
        """
        register = self.registers[name]
        if register.sign is not None and value < 0:
            value = -value | 1 << register.sign
        return value.to_bytes(register.size, "big" if self.big_endian else "little")

    def unpack(self, name: str, memory: bytes | bytearray, first: int = 0) -> int:
        """Return the value of a register.

        Args:
            name: Name of the register.
            memory: Bytes of the memory.
            first: Address of the first byte.
        """
        register = self.registers[name]
        begin = register.address - first
        part = memory[begin : begin + register.size]
        value = int.from_bytes(part, "big" if self.big_endian else "little")
        if register.sign is not None and value >> register.sign & 1:
            return -(value & ~(1 << register.sign))
        return value


_COMMON = {
    "model": Register(3, 2, initial=777, kept=True),
    "id": Register(5, initial=1, kept=True),
    "baud_rate": Register(6, kept=True),
    "response_level": Register(8, initial=1, kept=True),
    "min_angle": Register(9, 2, kept=True),
    "max_angle": Register(11, 2, initial=4095, kept=True),
    "max_temperature": Register(13, initial=70, kept=True),
    "max_voltage": Register(14, initial=140, kept=True),
    "min_voltage": Register(15, initial=40, kept=True),
    "max_torque": Register(16, 2, initial=1000, kept=True),
    "dead_zone_cw": Register(26, initial=1, kept=True),
    "dead_zone_ccw": Register(27, initial=1, kept=True),
    "torque_enable": Register(40),
    "goal_position": Register(42, 2, 15),
    "goal_time": Register(44, 2),
    "goal_speed": Register(46, 2, 15),
    "position": Register(56, 2, 15),
    "speed": Register(58, 2, 15),
    "load": Register(60, 2, 10),
    "voltage": Register(62),
    "temperature": Register(63),
    "status": Register(65),
    "moving": Register(66),
}

STS = Series(
    "sts",
    big_endian=False,
    sync_read=True,
    ticks=4096,
    turn=360.0,
    registers=_COMMON
    | {
        "offset": Register(31, 2, 11, kept=True),
        "mode": Register(33, kept=True),
        "acceleration": Register(41),
        "torque_limit": Register(48, 2, initial=1000),
        "lock": Register(55, initial=1),
        "current": Register(69, 2, 15),
    },
)

SCS = Series(
    "scs",
    big_endian=True,
    sync_read=False,
    ticks=1024,
    turn=300.0,
    registers=_COMMON
    | {
        "model": Register(3, 2, initial=1284, kept=True),
        "max_angle": Register(11, 2, initial=1023, kept=True),
        "lock": Register(48, initial=1),
    },
)

# Registers that a calibration may change, by their names in `ServoReport.kept`. A series may lack
# the offset and the mode.
KEPT = {
    "id": "id",
    "baud_rate": "baud_rate",
    "homing": "offset",
    "least": "min_angle",
    "most": "max_angle",
    "mode": "mode",
}

# Settings that limit motions and that another program may have changed. Their initial values limit
# nothing. A series may lack the first one.
SETTINGS = ("acceleration", "goal_time", "goal_speed")

CURRENT_UNIT = 0.0065  # unit of the register `current` [A]

# Speeds of the line by the value of the register `baud_rate` [bit/s].
BAUDS = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)

# Error bits of a status packet, which the register `status` repeats.
ERRORS = {
    0x01: "voltage",
    0x02: "angle sensor",
    0x04: "temperature",
    0x08: "current",
    0x20: "overload",
}
