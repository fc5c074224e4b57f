"""A model of one servo: memory, motion, load and temperature."""

import math

from hardware.drivers.feetech.registers import MEMORY, Series

_STEP = 0.001  # of the integration [s]
_TOP_SPEED = 3400.0  # speed without a goal speed [ticks/s]; the largest that `st3215` allows
_ACCELERATION = 100.0  # of one unit of the register [ticks/s2]
_TOP_ACCELERATION = 25400.0  # without one [ticks/s2]
_SUPPLY, _SAG = 12.0, 0.4  # voltage without a load [V], and what the full load of a servo takes [V]
_AMBIENT, _HEAT, _COOLING = 25.0, 50.0, 300.0  # [C], rise at full load [C], time constant [s]
_STALL_CURRENT = 2.7  # at full load [A]
_STALL_TIME = 0.5  # of a blocked servo until it reports an overload [s]
_CURRENT_UNIT = 0.0065  # [A]


class Servo:
    """A servo. It follows its goal with a limited speed and acceleration.

    Its load is roughly that of an arm that its joint holds: `gravity` times the cosine of the angle
    from the middle, and what accelerating needs.

    Args:
        series: Its series.
        servo: Its id.
        position: Where it stands [ticks].
        gravity: Load that holds the arm where it is heaviest, as a part of the largest torque.

    Attributes:
        memory: Its memory.
        blocked: Whether something keeps it from moving.
        supply: Voltage of its supply without a load [V].
        ambient: Temperature around it [C].
    """

    def __init__(self, series: Series, servo: int, position: int, gravity: float = 0.0) -> None:
        self.series, self._gravity = series, gravity
        self.memory = bytearray(MEMORY)
        self.blocked, self.supply, self.ambient = False, _SUPPLY, _AMBIENT
        self._position, self._speed, self._load = float(position), 0.0, 0.0
        self._temperature, self._now = _AMBIENT, 0.0
        self._stalled = 0.0  # for so long it was blocked [s]
        for name, register in series.registers.items():
            self.put(name, register.initial)
        self.put("id", servo)
        self.put("goal_position", position)
        self._saved = bytes(self.memory[: series.blocks[1][0]])
        self._report()

    @property
    def kept(self) -> dict[str, int]:
        """What it keeps without power, by register."""
        registers = self.series.registers.items()
        return {name: self.series.unpack(name, self._saved) for name, r in registers if r.kept}

    @property
    def servo(self) -> int:
        """Its id."""
        return self.get("id")

    @property
    def position(self) -> float:
        """Where it stands [ticks]."""
        return self._position

    @property
    def _homing(self) -> int:
        """Its offset [ticks], which it subtracts from what it measures."""
        return self.get("offset") if "offset" in self.series.registers else 0

    def get(self, name: str) -> int:
        """Return the value of a register."""
        return self.series.unpack(name, self.memory)

    def put(self, name: str, value: int) -> None:
        """Set a register, also one that no packet can write."""
        address = self.series.registers[name].address
        data = self.series.pack(name, value)
        self.memory[address : address + len(data)] = data

    def write(self, address: int, values: bytes) -> None:
        """Write to the memory, as a packet does. What the servo reports cannot be written."""
        reports = self.series.registers["position"].address
        values, before = values[: max(0, reports - address)], self._homing
        locked = self.get("lock")
        self.memory[address : address + len(values)] = values
        if not locked:  # what is written to a locked memory is lost with the power
            self._saved = bytes(self.memory[: self.series.blocks[1][0]])
        self._position = (self._position + before - self._homing) % self.series.ticks

    def restart(self) -> None:
        """Lose the power for a moment: what it keeps remains, and the torque is off."""
        self.memory[: len(self._saved)] = self._saved
        for name, register in self.series.registers.items():
            if len(self._saved) <= register.address < self.series.blocks[2][0]:
                self.put(name, register.initial)
        self.put("goal_position", round(self._position))
        self._speed = 0.0
        self._report()

    def push(self, position: float) -> None:
        """Move it by hand [ticks]. It gives way only without torque."""
        if not self.get("torque_enable"):
            self._position = position % self.series.ticks
            self._report()

    def advance(self, now: float) -> None:
        """Move until a time [s], which never decreases."""
        while now - self._now >= _STEP:
            if self._resting():
                self._warm(now - self._now)
                self._now = now
            else:
                self._warm(_STEP)
                self._move()
                self._now += _STEP
        self._report()

    def _resting(self) -> bool:
        return self._speed == 0.0 and not self._wants()

    def _wants(self) -> float:
        """Return how far it wants to move [ticks]; 0 inside its dead zone, or without torque."""
        if not self.get("torque_enable") or self.get("status"):
            return 0.0
        goal = self.get("goal_position")
        if self.get("min_angle") or self.get("max_angle"):  # both are 0 for many turns
            goal = min(max(goal, self.get("min_angle")), self.get("max_angle"))
        ahead = goal - self._position
        zone = self.get("dead_zone_cw" if ahead > 0 else "dead_zone_ccw")
        return ahead if abs(ahead) > zone or self._speed else 0.0

    def _move(self) -> None:
        ahead = self._wants()
        top = self.get("goal_speed") or _TOP_SPEED
        units = self.get("acceleration") if "acceleration" in self.series.registers else 0
        most = units * _ACCELERATION or _TOP_ACCELERATION
        brake = math.sqrt(2 * most * abs(ahead))  # the speed from which it can still stop there
        wanted = math.copysign(min(top, brake, abs(ahead) / _STEP), ahead) if ahead else 0.0
        change = min(max(wanted - self._speed, -most * _STEP), most * _STEP)
        self._speed = 0.0 if self.blocked else self._speed + change
        self._position += self._speed * _STEP
        if abs(ahead) <= 0.5:  # the encoder sees no difference
            self._speed = 0.0
        accelerating = 0.3 * change / (most * _STEP)
        self._load = self._held() + accelerating
        if self.blocked and ahead:
            self._load = math.copysign(self._most_torque(), ahead)
            self._stalled += _STEP

    def _most_torque(self) -> float:
        """Return its largest torque, as a part of what the series has."""
        registers = {"max_torque", "torque_limit"} & self.series.registers.keys()
        return min(map(self.get, registers)) / 1000

    def _held(self) -> float:
        """Return the load that gravity makes, as a part of the largest torque."""
        angle = math.radians((self._position / self.series.ticks - 0.5) * self.series.turn)
        return self._gravity * math.cos(angle) if self.get("torque_enable") else 0.0

    def _warm(self, seconds: float) -> None:
        """Warm up or cool down towards the temperature that the load makes."""
        if self._resting():
            self._load = self._held()
        goal = self.ambient + _HEAT * self._load**2
        self._temperature += (goal - self._temperature) * -math.expm1(-seconds / _COOLING)

    def _report(self) -> None:
        """Write what it measures to its memory."""
        voltage = self.supply - _SAG * abs(self._load)
        self.put("position", round(self._position))
        self.put("speed", round(self._speed))
        self.put("load", round(min(max(self._load, -1.0), 1.0) * 1000))
        self.put("voltage", round(max(voltage, 0.0) * 10))
        self.put("temperature", round(self._temperature))
        self.put("moving", int(self._speed != 0.0))
        if "current" in self.series.registers:
            self.put("current", round(self._load * _STALL_CURRENT / _CURRENT_UNIT))
        low, high = self.get("min_voltage"), self.get("max_voltage")
        status = 0x01 * (not low <= self.get("voltage") <= high)
        status |= 0x04 * (self.get("temperature") > self.get("max_temperature"))
        if not self.get("torque_enable"):
            self._stalled = 0.0
        status |= 0x20 * (self._stalled > _STALL_TIME)
        self.put("status", status)
