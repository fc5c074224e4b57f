"""A model of a half-duplex bus with servos. It has no clock and does no I/O.

`drivers/virtual` puts it behind a pseudo-terminal, or behind a link in this process.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from operator import and_

from hardware.drivers.feetech.packets import BROADCAST, Instruction, Packet, take_packets
from hardware.link.link import BITS_PER_BYTE
from hardware.loading.dataclass import dataclass

from .servo import Servo

DELAY = 0.0001  # delay from a packet to its answer [s]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that the model injects.

    Attributes:
        kind: `vanish` (the servo leaves the bus), `block` (it cannot move), `overheat`, `brown_out`
            (its voltage drops), `restart` (it loses its power for a moment), `renumber` (it gets
            the id `value`), `impersonate` (it answers with the id `value`), `lose` (its next
            `value` answers are lost) or `damage` (its next `value` answers have a wrong bit).
        servo: Id of the servo.
        time: Start of the fault [s].
        value: See `kind`.
    """

    kind: str
    servo: int
    time: float
    value: int = 1


@dataclass(frozen=True, slots=True)
class BusState:
    """The state of a bus.

    Attributes:
        positions: Positions of the servos, by id [ticks].
        outputs: Positions of their output shafts, by id [ticks]: off by half the backlash.
        torque: True if the servo has torque, by id.
        collisions: Number of times that the host sent bytes while a servo answered.
    """

    positions: dict[int, float]
    outputs: dict[int, float]
    torque: dict[int, bool]
    collisions: int


class Bus:
    """A model of a bus. The caller passes the time [s], which never decreases.

    Args:
        servos: The servos. Two may have the same id.
        baud: Speed of the line [bit/s].
        faults: Faults to inject. Default: none.
    """

    def __init__(self, servos: Sequence[Servo], baud: int, faults: Iterable[Fault] = ()) -> None:
        self.servos, self._chain = list(servos), list(servos)
        self._byte = BITS_PER_BYTE / baud
        self._faults = sorted(faults, key=lambda fault: fault.time)
        self._arriving = deque[tuple[float, int]]()  # bytes to the servos, and their times
        self._leaving = deque[tuple[float, bytes]]()  # answers, and the times of their last bytes
        self._received = bytearray()
        self._losing, self._damaging = dict[int, int](), dict[int, int]()
        self._names = dict[int, int]()  # wrong ids in answers, by the right id
        self._collisions = 0
        self._now = 0.0

    def open(self, now: float) -> None:
        """Open the port. The servos do not notice this. Unread answers are lost."""
        self._advance(now)
        self._leaving.clear()
        self._received.clear()

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line. They arrive one by one, at the speed of the line."""
        self._advance(now)
        if data and any(end > now for end, _ in self._leaving):
            self._collisions += 1  # both sides drive the wire, which damages the answer
            answers = self._leaving
            self._leaving = deque((end, _damaged(a) if end > now else a) for end, a in answers)
        end = max(now, self._arriving[-1][0]) if self._arriving else now
        for byte in data:
            end += self._byte
            self._arriving.append((end, byte))

    def push(self, now: float, positions: Mapping[int, float]) -> None:
        """Move servos by hand, all at once [ticks]. Servos with torque do not move."""
        self._advance(now)
        for each in self.servos:
            if each.servo in positions:
                each.push(positions[each.servo])

    def fail(self, now: float, fault: Fault) -> None:
        """Inject a fault now."""
        self._advance(now)
        self._begin(fault)

    def connect(self, now: float, places: Sequence[int] | None = None) -> None:
        """Connect only the servos at these places in the chain, counted from 0. Default: all."""
        self._advance(now)
        everywhere = range(len(self._chain))
        self.servos = [self._chain[k] for k in (everywhere if places is None else places)]

    def kept(self, now: float) -> list[dict[str, int]]:
        """Return the values that each connected servo stores without power, by register."""
        self._advance(now)
        return [servo.kept for servo in self.servos]

    def cut_off(self, now: float) -> None:
        """Drop the bytes that have not arrived."""
        self._advance(now)
        self._arriving.clear()

    def read_output(self, now: float) -> bytes:
        """Return the answers that have been sent, and remove them."""
        self._advance(now)
        data = b""
        while self._leaving and self._leaving[0][0] <= now:
            data += self._leaving.popleft()[1]
        return data

    def next_output(self) -> float | None:
        """Return the time of the next output if no byte is received [s]; None for no output."""
        times = [self._arriving[-1][0]] if self._arriving else []
        return min([*times, *(end for end, _ in self._leaving)], default=None)

    def state(self, now: float) -> BusState:
        """Return the state of the bus."""
        self._advance(now)
        return BusState(
            {servo.servo: servo.position for servo in self.servos},
            {servo.servo: servo.output for servo in self.servos},
            {servo.servo: bool(servo.get("torque_enable")) for servo in self.servos},
            self._collisions,
        )

    def _advance(self, now: float) -> None:
        while self._arriving and self._arriving[0][0] <= now:
            time, byte = self._arriving.popleft()
            self._received.append(byte)
            for packet in take_packets(self._received):
                self._run_until(time)
                self._process(packet, time)
        self._run_until(now)

    def _run_until(self, now: float) -> None:
        while self._faults and self._faults[0].time <= now:
            fault = self._faults.pop(0)
            self._run_until(max(fault.time, self._now))
            self._begin(fault)
        for servo in self.servos:
            servo.advance(now)
        self._now = max(now, self._now)

    def _begin(self, fault: Fault) -> None:
        answering = {"impersonate": self._names, "lose": self._losing, "damage": self._damaging}
        if fault.kind in answering:
            answering[fault.kind][fault.servo] = fault.value
            return
        for servo in [each for each in self.servos if each.servo == fault.servo]:
            match fault.kind:
                case "vanish":
                    self.servos.remove(servo)
                case "block":
                    servo.blocked = True
                case "overheat":
                    servo.ambient = 500.0
                case "brown_out":
                    servo.supply = 3.5
                case "restart":
                    servo.restart()
                case "renumber":
                    servo.put("id", fault.value)

    def _process(self, packet: Packet, time: float) -> None:
        parameters = packet.parameters
        named = [each for each in self.servos if packet.servo in (BROADCAST, each.servo)]
        match packet.code, len(parameters):
            case Instruction.PING, 0:
                self._answer(named, [b""] * len(named), time)
            case Instruction.READ, 2 if packet.servo != BROADCAST:
                self._answer(named, [each.read(*parameters) for each in named], time)
            case Instruction.WRITE, count if count:
                for servo in named:
                    servo.write(parameters[0], parameters[1:])
                answers = packet.servo != BROADCAST
                talking = [each for each in named if answers and each.get("response_level")]
                self._answer(talking, [b""] * len(talking), time)
            case Instruction.SYNC_WRITE, count if count > 2:
                address, size = parameters[:2]
                for begin in range(2, len(parameters) - size, size + 1):
                    for servo in self.servos:
                        if servo.servo == parameters[begin]:
                            servo.write(address, parameters[begin + 1 : begin + 1 + size])
            case Instruction.SYNC_READ, count if count > 2:
                address, size, *ids = parameters
                know = [each for each in self.servos if each.series.sync_read]
                asked = [each for servo in ids for each in know if each.servo == servo]
                self._answer(asked, [each.read(address, size) for each in asked], time)

    def _answer(self, servos: Sequence[Servo], values: Sequence[bytes], time: float) -> None:
        """Put answers on the line, one after another.

        Servos with one id answer at the same time. Equal answers look like one answer. Different
        answers damage each other: a bit is 0 if any servo sends 0.
        """
        together = dict[int, list[bytes]]()
        for servo, value in zip(servos, values, strict=True):
            name = self._names.get(servo.servo, servo.servo)
            answer = Packet(name, servo.get("status"), value).data
            together.setdefault(servo.servo, []).append(answer)
        end = time + DELAY
        for number, answers in together.items():
            data = bytes(reduce(and_, each) for each in zip(*answers, strict=True))
            end += len(data) * self._byte
            if self._losing.get(number, 0):
                self._losing[number] -= 1
                continue
            if self._damaging.get(number, 0):
                self._damaging[number] -= 1
                data = _damaged(data)
            self._leaving.append((end, data))


def _damaged(data: bytes) -> bytes:
    """Return a packet with one bit changed."""
    return data[:-1] + bytes([data[-1] ^ 0x10]) if data else data
