"""Requests and answers on the bus: one sync write and one sync read in each cycle.

The servos of a series without sync read get one read each instead.

Only one side may send at a time. A request to all servos follows each frame. The next frame waits
for the answers or their timeout.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

from hardware.drivers.board_protocol import BoardProtocol
from hardware.drivers.servo_bus import POSITION_MODE
from hardware.drivers.servo_errors import (
    CalibrationDiffers,
    NoServos,
    ServoFault,
    ServoHealth,
    ServoMissing,
    ServoSilent,
    TorqueLost,
    WrongMode,
)
from hardware.drivers.wire_format import Frame

from .packets import Packet, read, sync_read, take_packets
from .registers import ERRORS, KEPT, MEMORY, SETTINGS
from .wire_format import ServoFormat

# Six answers take 1 ms on the line. A USB adapter may delay them by another 16 ms. Answers come one
# after another. If no more come after the first ones, the rest is lost, so its timeout is short: it
# follows the measured delay of this adapter and host. If no answer comes, the host may be busy.
ANSWER_TIMEOUT = 0.02  # timeout of the first answer; largest timeout of the rest [s]
_LEAST_TIMEOUT = 0.003  # smallest timeout of the rest [s]
_TIMES_SLOWEST = 2.0  # factor from the time of the slowest of the last cycles to this timeout
_HOST_LATE = 0.005  # a request later than this may show a busy host, not a silent servo [s]
_REMEMBERED = 0.99  # factor that the slowest cycle decays by in each cycle
_IDLE_PERIOD = 0.2  # period of requests while nothing moves [s]
_SETTLING = 1.0  # time after a frame in which the arm may move [s]
_TIMES_ALL = 2  # factor of `allowed` if no servo answers: the host or adapter may be busy
_STATE_PERIOD = 0.1  # period of requests that include the torque [s]
_LIMP = 5  # number of answers that may report no torque after it was switched on
_MEASURED = {"position", "speed", "load", "max_torque", "temperature", "voltage", "current"}
# The answers of two servos with one id may overlap, and look like one answer with a wrong position.
_FASTEST, _PLAY = 360.0, 2.0  # largest speed of a servo [deg/s], and error of its position [deg]
_WAY_IN_SPEED = 20.0  # speed at which a joint moves back inside its limits [deg/s]
_RAMP = 0.3  # time in which torque rises, by one step in each period of frames [s]


class BusProtocol(BoardProtocol):
    """Requests positions and health of all servos, and detects missing ones.

    Args:
        wires: Wire format of the joints.
        allowed: Number of lost answers of a servo in a row that are a fault.
        rate: Rate of frames, and of requests while the arm may move [Hz].
        silent_time: If a servo has not answered for this time, late requests count, too [s].
    """

    def __init__(self, wires: ServoFormat, allowed: int, rate: float, silent_time: float) -> None:
        self._series, self._wires = wires.series, wires
        self._allowed, self._rate, self._silent_time = allowed, rate, silent_time
        self._joints = {servo: joint for joint, servo in wires.servos.items()}
        kept, self._state, self._cycle = self._series.blocks
        # Blocks to request next; after them, only the block `_cycle` is requested. The first block
        # shows best if two servos have one id. The last block has the values behind an error.
        self._asked = [self._state, kept, self._state]
        self._received = bytearray()
        self._unasked = list[int]()  # servos that have not got their part of the last request
        self._waiting = set[int]()  # servos that have not answered the last request
        self._answers = dict[int, bytes]()  # answers to the last request, by servo
        self._heard = set[int]()  # servos that have answered since the port was opened
        self._doubtful = set[int]()  # ids that answered the last request twice or before their turn
        self._twice = Counter[int]()  # number of double answers, by id
        self._requests = 0
        self._noise = 0  # received bytes outside of packets since the last complete answers
        self._unanswered = dict.fromkeys(self._joints, 0)  # requests in a row without an answer
        self._silent = dict.fromkeys(self._joints, 0)  # number of these that were not late
        self._answered = dict.fromkeys(self._joints, -math.inf)  # last answered request [s]
        self._requested = -math.inf  # time of the last request [s]
        self._replied = dict.fromkeys(self._joints, -math.inf)  # last request with any answer [s]
        self._begun = -math.inf  # time of the first request, or part of one, of this cycle [s]
        self._slowest = 0.0  # time of the slowest of the last cycles [s]
        self._settles = -math.inf  # time until which the arm may move [s]
        self._moves_for = 0.0  # time that the next torque commands may move the arm [s]
        self._state_time = -math.inf  # time of the last answers with the torque [s]
        self._holds = False  # True if torque was switched on
        # Number of answers without torque still allowed.
        self._limp = dict.fromkeys(self._joints, _LIMP)
        self._memories = {servo: bytearray(MEMORY) for servo in self._joints}
        self._lost = dict.fromkeys(self._joints, 0)  # lost answers since the port was opened
        self.next_poll = -math.inf  # request the positions at once

    def check_booted(self, port: str, waited: float) -> None:
        """Check that all servos answered, and check their modes and calibrated values."""
        if not self._heard and self._noise:
            raise NoServos(port, waited, self._noise)
        if not self.boot_frame:
            waiting = self._joints.keys() - self._heard or self._waiting or self._joints
            missing = [f"{servo} ({self._joints[servo]})" for servo in sorted(waiting)]
            twice = [servo for servo, times in self._twice.items() if 2 * times > self._requests]
            raise ServoMissing(port, waited, missing, len(self._heard), twice, self._noise)
        if "mode" in self._series.registers:
            for (servo, joint), mode in zip(
                self._joints.items(), self._values("mode"), strict=True
            ):
                if mode != POSITION_MODE:
                    raise WrongMode(servo, joint, mode)
        for joint, name, expected in self._wires.kept:
            servo = self._wires.servos[joint]
            if (kept := self._series.unpack(KEPT[name], self._memories[servo])) != expected:
                raise CalibrationDiffers(servo, joint, name, kept, expected)

    def hold_commands(self) -> bytes:
        """Return the command that holds the servos at their measured positions."""
        self._store_answers()
        positions = self._values("position")
        return self._wires.command("goal_position", positions) if self.measured else b""

    def torque_commands(self, on: bool) -> Sequence[bytes]:
        """Return the commands that release the servos, or hold them at their positions.

        The goals are sent before the torque is switched on. Settings of other programs are reset
        after the goals, because a servo may still move to an earlier goal. The torque limit rises
        slowly from its present value, if the series has one. Then joints outside their limits move
        to these limits.
        """
        self._holds = on
        if not on:
            return [self._enable(0)]
        self.boot_frame = self._wires.frame(self._values("position"))
        ramp, goal = self._ramp(), self.boot_frame
        enable = self._settings + self._enable(1)
        commands = [*ramp[:1], goal.data, enable, *ramp[1:], *self._ways_in(goal)]
        self._moves_for = len(commands) / self._rate + _SETTLING
        return commands

    def _ramp(self) -> list[bytes]:
        """Return the commands that raise the torque limit; empty if the series has none."""
        if "torque_limit" not in self._series.registers:
            return []
        most, holding = self._values("max_torque"), self._values("torque_enable")
        # A program that ended before the torque limit had risen has left a small one.
        present = self._values("torque_limit")
        lows = [low if holds else 0 for low, holds in zip(present, holding, strict=True)]
        steps = round(_RAMP * self._rate) if lows != most else 0
        return [self._wires.command("torque_limit", each) for each in _line(lows, most, steps)]

    def _ways_in(self, frame: Frame) -> list[bytes]:
        """Return the commands that move the joints of a frame inside their limits; often none."""
        there = self._wires.encode(self._wires.decode(frame)).servos
        pairs = zip(frame.servos, there, strict=True)
        farthest = max(abs(b - a) for a, b in pairs) * self._series.turn / self._series.ticks
        steps = math.ceil(farthest / _WAY_IN_SPEED * self._rate)
        return [self._wires.frame(each).data for each in _line(frame.servos, there, steps)]

    @property
    def _settings(self) -> bytes:
        """Commands that reset the settings that other programs may have left."""
        registers = self._series.registers.items()
        initial = {name: register.initial for name, register in registers if name in SETTINGS}
        commands = (self._wires.command(n, [v] * len(self._joints)) for n, v in initial.items())
        return b"".join(commands)

    def _enable(self, on: int) -> bytes:
        """Return the command that switches the torque of all servos."""
        for servo, memory in self._memories.items():
            self._limp[servo] = _LIMP
            memory[self._state[0]] = on
        return self._wires.command("torque_enable", [on] * len(self._joints))

    def note_sent(self, frame: Frame, now: float) -> None:
        """Request the state of the servos right after a frame."""
        self._settles = now + _SETTLING
        if not self._waiting:
            self.next_poll = now

    def poll(self, now: float) -> bytes:
        """Return a request to all servos, after the answers or timeout of the last request.

        For a series without SYNC READ, the request is sent in parts: one part to each servo.

        Raises:
            ServoSilent: Servos did not answer several requests in a row.
        """
        timeout = ANSWER_TIMEOUT
        if not self._unasked:
            self._begin_request(now)
        else:
            self._begun = now
            timeout = self._rest if self.boot_frame else timeout
        self._received.clear()
        self.free_at = self.next_poll = now + timeout
        if self._series.sync_read:
            servos, self._unasked = self._unasked, []
            return sync_read(servos, *self._block)
        return read(self._unasked.pop(0), *self._block)

    def _begin_request(self, now: float) -> None:
        """Count the lost answers to the last request, and begin the next one.

        Raises:
            ServoSilent: Servos did not answer several requests in a row.
        """
        if not self._waiting:
            self._begun = now
        if self._moves_for:
            self._settles, self._moves_for = max(self._settles, now + self._moves_for), 0.0
        allowed, cycles = self._allowed * (1 if self._answers else _TIMES_ALL), dict[int, int]()
        self._store_answers()
        counts = now - self.next_poll < _HOST_LATE
        for servo in self._waiting | self._doubtful:
            self._lost[servo] += 1
            self._unanswered[servo] += 1
            self._silent[servo] += counts
            old = now - self._answered[servo] >= self._silent_time
            cycles[servo] = (self._unanswered if old else self._silent)[servo]
        if self.boot_frame and max(cycles.values(), default=0) >= allowed:
            raise self._silence({s: n for s, n in cycles.items() if n >= allowed})
        self._waiting, self._answers, self._doubtful = set(self._joints), {}, set()
        self._requests, self._requested = self._requests + 1, now
        self._unasked = list(self._joints)

    def _silence(self, cycles: Mapping[int, int]) -> ServoSilent:
        """Return the fault of silent servos. `cycles` has their unanswered requests in a row."""
        silent = [servo for servo in self._joints if servo in cycles]
        # A servo with doubtful answers is only named if no servo is without an answer.
        silent = [servo for servo in silent if servo in self._waiting] or silent
        names = [f"{servo} of {self._joints[servo]}" for servo in silent]
        least = min(cycles[servo] for servo in silent)
        return ServoSilent(names, len(self._joints), least, self._doubtful, self._noise)

    @property
    def _block(self) -> tuple[int, int]:
        """Address and number of the requested bytes."""
        return self._asked[0] if self._asked else self._cycle

    def receive(self, data: bytes, now: float) -> None:
        """Process answers. Answers of unknown servos and damaged answers are ignored.

        A measurement needs one answer of every servo to one request, in the order of the request.
        If a servo answers with the id of another one, its own answer is missing.

        Raises:
            ServoFault: A servo reports an error.
        """
        self._received += data
        before = len(self._received)
        packets = take_packets(self._received)
        self._noise += before - len(self._received) - sum(len(each.data) for each in packets)
        waiting = len(self._waiting)
        for packet in packets:
            if packet.servo in self._waiting:
                self._process(packet)
            elif packet.servo in self._joints:
                self._doubtful.add(packet.servo)
                self._twice[packet.servo] += 1
        if len(self._waiting) < waiting:
            self._schedule(now)

    def _schedule(self, now: float) -> None:
        """Set the times of the next frame and request, and process complete answers."""
        rest = self._rest
        if self._unasked:
            self._note_duration(now)
            self.next_poll = now
        # Before the end of the boot, no frame waits for the line.
        elif self._waiting and not self.boot_frame:
            self.free_at = self.next_poll = now + ANSWER_TIMEOUT
        elif self._waiting:
            # Never set to a later time: the streamer may be sending a frame, because it found the
            # line free.
            self.free_at = min(self.free_at, now + rest)
            self.next_poll = min(self.next_poll, now + rest)
        else:
            self._note_duration(now)
            rests = self._holds and now > self._settles
            # After a doubtful answer, another answer may still come.
            self.free_at = min(self.free_at, now + rest) if self._doubtful else -math.inf
            self.next_poll = now + (_IDLE_PERIOD if rests else 1 / self._rate)
            self._take_answers(now)

    @property
    def _rest(self) -> float:
        """Timeout of an answer after the first one [s]."""
        return min(max(_TIMES_SLOWEST * self._slowest, _LEAST_TIMEOUT), ANSWER_TIMEOUT)

    def _note_duration(self, now: float) -> None:
        self._slowest = max(now - self._begun, _REMEMBERED * self._slowest)

    def _process(self, packet: Packet) -> None:
        servo, (first, count) = packet.servo, self._block
        whole = len(packet.parameters) == count
        values_next = len(self._asked) > 1  # the next request reads the values behind an error
        if packet.code and not (whole and values_next):
            names = [name for bit, name in ERRORS.items() if packet.code & bit]
            memory = bytearray(self._memories[servo])
            if whole:
                memory[first : first + count] = packet.parameters
            before = abs(self._series.unpack("load", self._memories[servo]))
            health = self._health(memory, before)
            raise ServoFault(servo, self._joints[servo], names, health)
        if whole:  # else the packet answers another request
            # Servos answer in turn: an answer before its turn is for the previous request.
            turns = list(self._joints)
            self._doubtful |= self._answers.keys() & turns[turns.index(servo) :]
            self._waiting.discard(servo)
            self._heard.add(servo)
            self._answers[servo] = packet.parameters
            if self._holds and self._jumps(servo, packet.parameters):
                self._doubtful.add(servo)
            self._replied[servo] = self._requested

    def _jumps(self, servo: int, answer: bytes) -> bool:
        """Return True if a servo cannot have moved so far since the last request it answered."""
        first, count = self._block
        position = self._series.registers["position"]
        if not first <= position.address < first + count:
            return False
        before = self._series.unpack("position", self._memories[servo])
        moved = abs(self._series.unpack("position", answer, first) - before)
        degrees = moved * self._series.turn / self._series.ticks
        return degrees > _FASTEST * (self._requested - self._replied[servo]) + _PLAY

    def _health(self, memory: bytearray, load_before: int) -> ServoHealth:
        """Return the health of a servo from its memory.

        An overloaded servo lets the joint go, so `load_before` [0.1 %] may be the true cause.
        """

        def value(register: str) -> int:
            return self._series.unpack(register, memory)

        return ServoHealth(
            load=max(abs(value("load")), load_before) / 1000,
            most_load=value("max_torque") / 1000,
            celsius=value("temperature"),
            most_celsius=value("max_temperature"),
            volts=value("voltage") / 10,
            least_volts=value("min_voltage") / 10,
            most_volts=value("max_voltage") / 10,
        )

    def _take_answers(self, now: float) -> None:
        """Process the answers of all servos. If an answer is doubtful, the request is repeated."""
        self._store_answers()
        if self._doubtful:
            return
        self._noise = 0
        first, count = self._block
        if first <= self._state[0] < first + count:
            self._state_time = now
            self._check_torque()
        if self._asked:
            self._asked.pop(0)
        if self._asked:
            self.next_poll = now
            return
        present = _MEASURED & self._series.registers.keys()
        values = {name: self._values(name) for name in present}
        self.measured = self._wires.measurement(values, list(self._lost.values()))
        self.boot_frame = self.boot_frame or self._wires.frame(self._values("position"))
        if now - self._state_time >= _STATE_PERIOD:
            self._asked.append(self._state)

    def _store_answers(self) -> None:
        """Store the answers to the last request, so that a hold uses the latest positions."""
        first, count = self._block
        for servo, answer in self._answers.items():
            if servo not in self._doubtful:
                self._memories[servo][first : first + count] = answer
                self._silent[servo] = self._unanswered[servo] = 0
                self._answered[servo] = self._requested
        self._answers = {}

    def _check_torque(self) -> None:
        """Check that the servos have torque. The first answers after the command may have none."""
        for servo, holds in zip(self._joints, self._values("torque_enable"), strict=True):
            if holds:
                self._limp[servo] = 0
            elif self._holds:
                self._limp[servo] -= 1
                if self._limp[servo] < 0:
                    raise TorqueLost(servo, self._joints[servo])

    def _values(self, register: str) -> list[int]:
        """Return the last value of a register for every servo, in the order of joints."""
        return [self._series.unpack(register, memory) for memory in self._memories.values()]


def _line(start: Sequence[int], end: Sequence[int], steps: int) -> list[list[int]]:
    """Return the rows of values after each of `steps` equal steps from the start to the end."""
    parts = range(1, steps + 1)
    pairs = list(zip(start, end, strict=True))
    return [[a + (b - a) * part // steps for a, b in pairs] for part in parts]
