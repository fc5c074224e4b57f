"""Requests to single servos over an open port: pings, reports and stored values."""

from collections.abc import Iterable, Mapping, Sequence

from hardware.clock import Clock
from hardware.drivers.servo_bus import Found, ServoReport
from hardware.drivers.servo_errors import NotKept, NotReleased
from hardware.errors import HardwareError, PortLost
from hardware.link.link import Link

from .packets import Instruction, Packet, read, sync_read, take_packets, write
from .registers import ERRORS, KEPT, Series

# An answer may take 25 ms; a USB adapter may delay it by 16 ms. There are several waits, because a
# stall of the whole host ends one of them without giving the answer time to arrive.
_WAITS, _WAIT = 5, 0.005  # number of waits, and length of a wait [s]
_TRIES = 3


class FeetechBus:
    """A bus with servos on a link, for requests to single servos.

    Args:
        series: Series of the servos.
        link: The link, which is not open.
        clock: Time source.
    """

    def __init__(self, series: Series, link: Link, clock: Clock) -> None:
        self._series, self._link, self._clock = series, link, clock
        self._changed = clock.signal()
        self._received = bytearray()
        self._noise = 0  # received bytes outside of packets
        self._error: HardwareError | None = None
        self.ticks, self.turn = series.ticks, series.turn

    def __enter__(self) -> "FeetechBus":
        self._error = None
        self._link.open()
        self._reader = self._clock.spawn(self._read, "bus reader")
        return self

    def __exit__(self, *raised: object) -> None:
        self._link.close()
        self._reader.join()

    def find(self, ids: Iterable[int]) -> Found:
        """Return the reports of the servos with these ids, and signs of problems.

        Two servos with one id answer a ping with equal bytes, which look like one answer. Their
        reports differ, and damage each other.
        """
        servos, strangers = dict[int, ServoReport](), dict[int, int]()
        damaged = dict[int, int]()  # number of bytes outside of packets, by id
        heard, asked = set[int](), list(ids)
        for servo in asked:
            before, packets = self._noise, self._ping(servo)
            heard |= {packet.servo for packet in packets}
            present = any(packet.servo == servo for packet in packets)
            if present and (report := self._report(servo)):
                servos[servo] = report
            elif packets and not present:
                strangers[servo] = packets[0].servo
            elif self._noise > before:
                damaged[servo] = self._noise - before
        for servo in heard.intersection(asked) - servos.keys() - damaged.keys():
            if report := self._report(servo):  # its answer was late
                servos[servo] = report
                strangers = {k: other for k, other in strangers.items() if servo not in (k, other)}
        return Found(servos, frozenset(damaged), sum(damaged.values()), strangers)

    def _ping(self, servo: int) -> list[Packet]:
        """Ping a servo, once more if no byte comes, and return the answers."""
        request, before = Packet(servo, Instruction.PING).data, self._noise
        answers = self._ask(request, [servo])
        return self._ask(request, [servo]) if not answers and self._noise == before else answers

    def positions(self, ids: Sequence[int]) -> dict[int, int]:
        """Return the positions of the servos that answer [ticks], by id."""
        if not self._series.sync_read:
            found = {servo: self._get(servo, "position") for servo in ids}
            return {servo: ticks for servo, ticks in found.items() if ticks is not None}
        register = self._series.registers["position"]
        packets = self._ask(sync_read(ids, register.address, register.size), ids)
        return {
            packet.servo: self._series.unpack("position", packet.parameters, register.address)
            for packet in packets
            if len(packet.parameters) == register.size and packet.servo in ids
        }

    def release(self, ids: Sequence[int]) -> None:
        """Switch the torque of servos off, and check this.

        Raises:
            NotReleased: A servo still has torque, or does not answer.
        """
        for servo in ids:
            self._put(servo, "torque_enable", 0)
        if holding := [servo for servo in ids if self._get(servo, "torque_enable") != 0]:
            raise NotReleased(holding)

    def keep(self, servo: int, values: Mapping[str, int]) -> None:
        """Write stored values of a servo, and check them.

        A new id applies at once, so it must be the last value.

        Raises:
            NotKept: The servo reads back another value, or does not answer.
        """
        first = servo
        self._put(servo, "lock", 0)
        try:
            for name, value in values.items():
                register = KEPT[name]
                self._put(servo, register, value)
                servo = value if name == "id" else servo
                if (kept := self._get(servo, register)) != value:
                    raise NotKept(servo, name, value, kept)
        finally:
            for each in {first, servo}:  # the servo may not have accepted a new id
                self._put(each, "lock", 1)

    def _report(self, servo: int) -> ServoReport | None:
        """Return the report of a servo; None if its answer is incomplete."""
        memory, errors = bytearray(), 0
        for first, count in self._series.blocks[:2]:
            packet = self._answer(servo, read(servo, first, count), count)
            if packet is None:
                return None
            memory += packet.parameters
            errors |= packet.code
        values = {name: self._series.unpack(name, memory) for name in self._series.registers}
        return ServoReport(
            servo=servo,
            model=values["model"],
            firmware=f"{memory[0]}.{memory[1]}",
            voltage=values["voltage"] / 10,
            temperature=values["temperature"],
            position=values["position"],
            torque=bool(values["torque_enable"]),
            errors=tuple(name for bit, name in ERRORS.items() if errors & bit),
            kept={name: values[register] for name, register in KEPT.items() if register in values},
        )

    def _get(self, servo: int, register: str) -> int | None:
        """Return the value of a register, or None if the servo does not answer."""
        place = self._series.registers[register]
        packet = self._answer(servo, read(servo, place.address, place.size), place.size)
        return self._series.unpack(register, packet.parameters, place.address) if packet else None

    def _put(self, servo: int, register: str, value: int) -> None:
        data = self._series.pack(register, value)
        self._answer(servo, write(servo, self._series.registers[register].address, data), 0)

    def _answer(self, servo: int, request: bytes, count: int) -> Packet | None:
        """Return an answer of a servo with `count` parameters; None after three tries."""
        for _ in range(_TRIES):
            for packet in self._ask(request, [servo]):
                if packet.servo == servo and len(packet.parameters) == count:
                    return packet
        return None

    def _ask(self, request: bytes, servos: Sequence[int]) -> list[Packet]:
        """Send a request, and return the answers until each of these servos has answered.

        After a timeout there are fewer. Other answers are of servos with a wrong id, or late.
        """
        with self._changed:
            self._received.clear()
        self._link.write(request)
        waits, until = _WAITS * len(servos), self._clock.now() + _WAIT
        answers, missing = list[Packet](), set(servos)
        with self._changed:
            while missing and waits:
                self._changed.wait(until)
                if self._clock.now() >= until:
                    waits, until = waits - 1, self._clock.now() + _WAIT
                if self._error:
                    raise self._error
                before = len(self._received)
                found = take_packets(self._received)
                whole = sum(len(packet.data) for packet in found)
                self._noise += before - whole - len(self._received)
                answers += found
                missing -= {packet.servo for packet in found}
            self._noise += len(self._received)
            return answers

    def _read(self) -> None:
        """Read until the link is closed or lost."""
        try:
            while data := self._link.read():
                with self._changed:
                    self._received += data
                    self._changed.notify()
        except PortLost as error:
            with self._changed:
                self._error = error
                self._changed.notify()
