"""Requests and answers on the bus: one sync write and one sync read in each cycle.

Only one side may talk at a time. A request for all servos goes out right after a frame, and the
next frame waits for the answers or their timeout.
"""

import math

from hardware.drivers.board_protocol import BoardProtocol
from hardware.drivers.wire_format import Frame
from hardware.errors import BoardSilent, ServoFault, ServoSilent

from .packets import Packet, sync_read, take_packets
from .registers import ERRORS, Series
from .wire_format import ServoFormat

# Six answers take 1.3 ms on the line, and a USB adapter may keep them for another 16 ms.
ANSWER_TIMEOUT = 0.02  # [s]
_IDLE_PERIOD = 0.2  # between requests while nothing moves [s]
LOST_CYCLES = 5  # cycles in a row without the answer of a servo that are a fault


class BusProtocol(BoardProtocol):
    """Asks all servos where they are, how they are, and whether they are still there.

    Args:
        series: Series of the servos.
        wires: Wire format of the joints.

    Attributes:
        lost: Number of lost answers of each servo since the port was opened.
    """

    def __init__(self, series: Series, wires: ServoFormat) -> None:
        self._series, self._wires = series, wires
        self._joints = {servo: joint for joint, servo in wires.servos.items()}
        self._first = series.registers["position"].address
        last = max(self._first, *(r.address + r.size for r in series.registers.values()))
        self._count = last - self._first
        self._request = sync_read(list(self._joints), self._first, self._count)
        self._received = bytearray()
        self._waiting = set[int]()  # servos that have not answered the last request
        self._silent = dict.fromkeys(self._joints, 0)  # cycles in a row without an answer
        self._answers = dict[int, bytes]()  # last values of each servo, from the position on
        self.lost = dict.fromkeys(self._joints, 0)
        self.next_poll = -math.inf  # ask at once where the servos are

    def check_booted(self, port: str, waited: float) -> None:
        """Check that all servos answered."""
        if missing := [servo for servo in self._joints if servo not in self._answers]:
            named = ", ".join(f"{servo} ({self._joints[servo]})" for servo in missing)
            one = len(missing) == 1
            what = f"the position of {'servo' if one else 'servos'} {named}"
            advice = "Check their power, ids and baud rate, and the cable to the first of them"
            if one:
                advice = "Check its power, id and baud rate, and the cable to it"
            raise BoardSilent(port, waited, what, advice)

    def start_commands(self) -> bytes:
        """Return the commands that hold the servos where they are: goal first, then torque."""
        return self._hold() + self._wires.command("torque_enable", [1] * len(self._joints))

    def fault_commands(self, torque_off: bool) -> bytes:
        """Return the command that lets the servos go, or holds them where they are."""
        if torque_off:
            return self._wires.command("torque_enable", [0] * len(self._joints))
        return self._hold() if len(self._answers) == len(self._joints) else b""

    def _hold(self) -> bytes:
        return self._wires.command("goal_position", self._values("position"))

    def note_sent(self, frame: Frame, now: float) -> None:
        """Ask for the state of the servos right after a frame."""
        if not self._waiting:
            self.next_poll = now

    def poll(self, now: float) -> bytes:
        """Return a request to all servos. The last one has been answered, or its time is over.

        Raises:
            ServoSilent: A servo did not answer several requests in a row.
        """
        for servo in self._waiting:
            self.lost[servo] += 1
            self._silent[servo] += 1
            if self.boot_frame and self._silent[servo] >= LOST_CYCLES:
                raise ServoSilent(servo, self._joints[servo], self._silent[servo])
        self._waiting = set(self._joints)
        self._received.clear()
        self.free_at = self.next_poll = now + ANSWER_TIMEOUT
        return self._request

    def receive(self, data: bytes, now: float) -> None:
        """Process answers. Answers of unknown servos and damaged ones are ignored.

        Raises:
            ServoFault: A servo reports an error.
        """
        self._received += data
        for packet in take_packets(self._received):
            if packet.servo in self._waiting:
                self._process(packet)
                if not self._waiting:
                    self.free_at, self.next_poll = -math.inf, now + _IDLE_PERIOD
                    self._measure()

    def _process(self, packet: Packet) -> None:
        servo, first = packet.servo, self._first
        if packet.code:
            names = [name for bit, name in ERRORS.items() if packet.code & bit]
            temperature = self._series.unpack("temperature", packet.parameters, first)
            volts = self._series.unpack("voltage", packet.parameters, first) / 10
            raise ServoFault(servo, self._joints[servo], names, temperature, volts)
        if len(packet.parameters) != self._count:
            return  # the answer to another request
        self._waiting.discard(servo)
        self._silent[servo] = 0
        self._answers[servo] = packet.parameters
        if self.boot_frame is None and len(self._answers) == len(self._joints):
            self.boot_frame = self._wires.frame(self._values("position"))

    def _values(self, register: str) -> list[int]:
        """Return the last value of a register of every servo, by joint."""
        answers = (self._answers[servo] for servo in self._joints)
        return [self._series.unpack(register, answer, self._first) for answer in answers]

    def _measure(self) -> None:
        """Take the answers of one whole cycle as a measurement."""
        names = ("position", "speed", "load", "temperature", "voltage")
        self.measured = self._wires.measurement(*map(self._values, names))
