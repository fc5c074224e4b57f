"""A model of one servo: memory, motion, load and temperature."""

import math
from collections import deque
from collections.abc import Mapping

from hardware.drivers.feetech.registers import CURRENT_UNIT, MEMORY, Series
from hardware.drivers.servo_bus import POSITION_MODE
from hardware.loading.dataclass import dataclass

_STEP = 0.001  # step of the integration [s]
_WINDOW = 20  # number of steps over which the servo measures its speed
_TOP_SPEED = 3400.0  # speed without a goal speed: largest of `st3215` [ticks/s]
_ACCELERATION = 100.0  # one unit of the register [ticks/s2]
_TOP_ACCELERATION = 25400.0  # acceleration without a value in the register [ticks/s2]
_SUPPLY, _SAG = 12.0, 0.4  # voltage without load, and its drop at full load [V]
_AMBIENT, _HEAT, _COOLING = 25.0, 50.0, 300.0  # [C], rise at full load [C], time constant [s]
_STALL_CURRENT = 2.7  # current at full load [A]
_BACKLASH = 1.0  # play of the gears and horn behind the encoder (SO-ARM100 issue 134) [deg]
_STALL_TIME = 0.5  # time until a blocked servo reports an overload [s]
_OVERLOAD = 0.8  # part of the torque from which a blocked servo is overloaded
_PUSH = 1 / 60  # load of a servo that an object blocks, for each tick to its goal

_WHEEL_MODE = 1

# Registers that change the motion of a servo; a series may lack the last three.
_LIMITED = ("goal_position", "min_angle", "max_angle")
_STEERING = {
    *_LIMITED,
    *("torque_enable", "dead_zone_cw", "dead_zone_ccw", "goal_speed", "goal_time", "max_torque"),
    *("min_voltage", "max_voltage", "max_temperature", "acceleration", "torque_limit", "mode"),
}


@dataclass(frozen=True, slots=True)
class _Settings:
    """Settings of a servo's motion, from its memory.

    Attributes:
        torque: True if the servo has torque.
        goal: Goal position within its limits [ticks]; infinite for a wheel that turns.
        zones: Dead zones below and above the goal [ticks].
        speed: Largest speed [ticks/s].
        acceleration: Largest acceleration [ticks/s2].
        effort: Largest torque, as a share of the series' largest torque.
        voltages: Smallest and largest voltage [0.1 V].
        hottest: Largest temperature [C].
    """

    torque: bool
    goal: float
    zones: tuple[int, int]
    speed: float
    acceleration: float
    effort: float
    voltages: tuple[int, int]
    hottest: int


class Servo:
    """A model of a servo. The servo moves to its goal with a limited speed and acceleration.

    Its load is roughly the load of an arm: `gravity` times the cosine of the angle from the middle,
    plus the load of accelerating.

    Args:
        series: Series of the servo.
        servo: Id of the servo.
        position: Position at the start [ticks].
        gravity: Load of holding the arm in the middle, as a share of the largest torque.

    Attributes:
        blocked: True if the servo cannot move. It then pushes with its full torque.
        stops: Lower and upper end of a range that the servo cannot leave [ticks]. An object may
            block it there. The range has no effect if the servo is outside.
        supply: Supply voltage without a load [V].
        ambient: Temperature of the air [C].
    """

    def __init__(self, series: Series, servo: int, position: int, gravity: float = 0.0) -> None:
        self.series, self._gravity = series, gravity
        self._memory, self._id = bytearray(MEMORY), series.registers["id"].address
        self._reports = series.registers["position"].address  # first address of the measured values
        self._settings: _Settings | None = None  # settings in its memory; None if not read yet
        self.blocked, self.supply, self.ambient = False, _SUPPLY, _AMBIENT
        self.stops = -math.inf, math.inf
        self._position, self._speed, self._load = float(position), 0.0, 0.0
        self._past = deque([self._position] * _WINDOW, _WINDOW)  # positions before the last steps
        self._side = 0.0  # side of the backlash on which its output is: -1, 1, or 0 at first
        self._temperature, self._now = _AMBIENT, 0.0
        self._stalled = 0.0  # time that it has been blocked and overloaded [s]
        for name, register in series.registers.items():
            self.put(name, register.initial)
        self.put("id", servo)
        self.put("goal_position", position)
        self._saved = bytes(self._memory[: series.blocks[1][0]])

    @property
    def kept(self) -> dict[str, int]:
        """The values that survive a loss of power, by register."""
        registers = self.series.registers.items()
        return {name: self.series.unpack(name, self._saved) for name, r in registers if r.kept}

    @property
    def servo(self) -> int:
        """Id of the servo."""
        return self._memory[self._id]

    @property
    def position(self) -> float:
        """Present position [ticks]."""
        return self._position

    @property
    def output(self) -> float:
        """Position of the output shaft [ticks], which the encoder does not measure.

        It differs by half the backlash, to the side to which the load pushes the shaft.
        """
        play = _BACKLASH * self.series.ticks / self.series.turn
        return self._position + self._side * play / 2

    @property
    def _homing(self) -> int:
        """Stored offset [ticks], which is subtracted from the measured position."""
        return self.get("offset") if "offset" in self.series.registers else 0

    def get(self, name: str) -> int:
        """Return the value of a register."""
        if self.series.registers[name].address >= self._reports:
            self._report()
        return self.series.unpack(name, self._memory)

    def put(self, name: str, value: int) -> None:
        """Set a register, also one that no packet can write."""
        self._settings = None
        self._store(name, value)

    def _store(self, name: str, value: int) -> None:
        address = self.series.registers[name].address
        data = self.series.pack(name, value)
        self._memory[address : address + len(data)] = data

    def read(self, address: int, count: int) -> bytes:
        """Return bytes of the memory; 0 at addresses without a register."""
        self._report()
        return bytes(self._memory[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, values: bytes) -> None:
        """Write to the memory as a packet does. Measured values cannot be written."""
        values, before = values[: max(0, self._reports - address)], self._homing
        locked, self._settings = self.get("lock"), None
        self._memory[address : address + len(values)] = values
        if not locked:  # values written to a locked memory are lost without power
            self._saved = bytes(self._memory[: self.series.blocks[1][0]])
        self._place(self._position + before - self._homing)
        self._forget_stall()

    def restart(self) -> None:
        """Lose the power for a moment. Stored values remain, and the torque is off."""
        self._memory[: len(self._saved)] = self._saved
        for name, register in self.series.registers.items():
            if len(self._saved) <= register.address < self._reports:
                self.put(name, register.initial)
        self.put("goal_position", round(self._position))
        self._speed = 0.0
        self._forget_stall()

    def _forget_stall(self) -> None:
        """Clear the overload if the servo has no torque."""
        if not self.get("torque_enable"):
            self._stalled = 0.0

    def push(self, position: float) -> None:
        """Move the servo by hand to a position [ticks]. A servo with torque does not move."""
        if not self.get("torque_enable"):
            self._place(position)

    def _place(self, position: float) -> None:
        """Set the position [ticks]. The measured speed does not change."""
        moved = position % self.series.ticks - self._position
        self._position += moved
        self._past.extend([each + moved for each in self._past])

    def advance(self, now: float) -> None:
        """Move until a time [s], which never decreases."""
        self._move_until(now)
        self._side = -math.copysign(1.0, self._load) if self._load else self._side

    def _move_until(self, now: float) -> None:
        while now - self._now >= _STEP:
            if self._speed == 0.0 and not self._wants():
                self._load = self._held()
                steps = min(int((now - self._now) / _STEP), _WINDOW)
                self._past.extend([self._position] * steps)
                self._warm(now - self._now)
                self._now = now
            else:
                self._warm(_STEP)
                self._move()
                self._now += _STEP

    def _set(self) -> _Settings:
        """Return the settings of the motion, from the memory."""
        if self._settings is None:
            present = {
                name: self.series.unpack(name, self._memory)
                for name in _STEERING & self.series.registers.keys()
            }
            goal = self._goal(present)
            speed = abs(present["goal_speed"]) or _TOP_SPEED
            if seconds := present["goal_time"] / 1000:
                speed = min(speed, abs(goal - self._position) / seconds)
            units = present.get("acceleration", 0)
            self._settings = _Settings(
                torque=bool(present["torque_enable"]),
                goal=goal,
                zones=(present["dead_zone_cw"], present["dead_zone_ccw"]),
                speed=speed,
                acceleration=units * _ACCELERATION or _TOP_ACCELERATION,
                effort=min(present["max_torque"], present.get("torque_limit", 1000)) / 1000,
                voltages=(present["min_voltage"], present["max_voltage"]),
                hottest=present["max_temperature"],
            )
        return self._settings

    def _goal(self, present: Mapping[str, int]) -> float:
        """Return the goal [ticks] for these values of registers. See `_Settings`."""
        mode, turns = present.get("mode", POSITION_MODE), present["goal_speed"]
        if mode != POSITION_MODE:
            wheel = mode == _WHEEL_MODE and turns
            return math.copysign(math.inf, turns) if wheel else self._position
        goal, low, high = (present[name] for name in _LIMITED)
        # Both limits are 0 in the mode for many turns.
        return min(max(goal, low), high) if low or high else goal

    def _wants(self) -> float:
        """Return the distance to the goal [ticks]; 0 inside the dead zone or without torque."""
        settings = self._set()
        if not settings.torque or self._errors():
            return 0.0
        ahead = settings.goal - self._position
        zone = settings.zones[ahead <= 0]
        return ahead if abs(ahead) > zone or self._speed else 0.0

    def _move(self) -> None:
        settings, ahead = self._set(), self._wants()
        most = settings.acceleration
        brake = math.sqrt(2 * most * abs(ahead))  # highest speed from which it can stop at the goal
        top = min(settings.speed, brake, abs(ahead) / _STEP)
        wanted = math.copysign(top, ahead) if ahead else 0.0
        change = min(max(wanted - self._speed, -most * _STEP), most * _STEP)
        self._speed = 0.0 if self.blocked else self._speed + change
        (least, last), before = self.stops, self._position
        self._past.append(before)
        self._position = moved = before + self._speed * _STEP
        if least <= before <= last:
            self._position = min(max(moved, least), last)
        touches = self._position != moved
        if math.isinf(settings.goal):
            self._position %= self.series.ticks
        if abs(ahead) <= 0.5 or touches:  # less than a tick
            self._speed = 0.0
        accelerating = 0.3 * change / (most * _STEP)
        self._load = self._held() + accelerating
        if ahead and (self.blocked or touches):
            push = settings.effort if self.blocked else min(settings.effort, _PUSH * abs(ahead))
            self._load = math.copysign(push, ahead)
            overloaded = push >= _OVERLOAD * settings.effort
            self._stalled = self._stalled + _STEP if overloaded else 0.0
        elif ahead:
            self._stalled = 0.0

    def _held(self) -> float:
        """Return the load of gravity, as a share of the largest torque."""
        angle = math.radians((self._position / self.series.ticks - 0.5) * self.series.turn)
        return self._gravity * math.cos(angle) if self._set().torque else 0.0

    def _warm(self, seconds: float) -> None:
        """Warm up or cool down towards the temperature for its load."""
        goal = self.ambient + _HEAT * self._load**2
        self._temperature += (goal - self._temperature) * -math.expm1(-seconds / _COOLING)

    @property
    def _voltage(self) -> int:
        """Supply voltage under the present load [0.1 V]."""
        return round(max(self.supply - _SAG * abs(self._load), 0.0) * 10)

    def _errors(self) -> int:
        """Return the error bits that the servo reports."""
        settings = self._set()
        low, high = settings.voltages
        errors = 0x01 * (not low <= self._voltage <= high)
        errors |= 0x04 * (round(self._temperature) > settings.hottest)
        return errors | 0x20 * (self._stalled > _STALL_TIME)

    def _report(self) -> None:
        """Write the measured values to the memory."""
        values = {
            "position": round(self._position),
            "speed": round((self._position - self._past[0]) / (_WINDOW * _STEP)),
            "load": round(min(max(self._load, -1.0), 1.0) * 1000),
            "voltage": self._voltage,
            "temperature": round(self._temperature),
            "status": self._errors(),
            "moving": int(self._speed != 0.0),
            "current": round(self._load * _STALL_CURRENT / CURRENT_UNIT),
        }
        for name in values.keys() & self.series.registers.keys():
            self._store(name, values[name])
