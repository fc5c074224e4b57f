"""Packets of the bus: `ff ff id length code parameters... checksum`.

In a packet to the servos, the code is an instruction. In a status packet from a servo, it has the
error bits. The length counts code, parameters and checksum. The checksum is the inverted sum of all
bytes from the id on. Source: Feetech, "SMS/STS communication protocol user manual".
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum

from hardware.loading.dataclass import dataclass

HEADER = b"\xff\xff"
BROADCAST = 0xFE  # id of all servos; none of them answers
LAST_ID = 0xFC
_LONGEST = 250  # parameters and checksum of the longest packet [bytes]


class Instruction(IntEnum):
    """Instructions in packets to the servos."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


@dataclass(frozen=True, slots=True)
class Packet:
    """A packet to or from a servo.

    Attributes:
        servo: Id of the servo.
        code: Instruction; in a status packet the error bits.
        parameters: The other bytes.
    """

    servo: int
    code: int
    parameters: bytes = b""

    @property
    def data(self) -> bytes:
        """Bytes of the packet on the bus."""
        body = bytes([self.servo, len(self.parameters) + 2, self.code]) + self.parameters
        return HEADER + body + bytes([~sum(body) & 0xFF])


def read(servo: int, address: int, count: int) -> bytes:
    """Return a request for `count` bytes of a servo's memory."""
    return Packet(servo, Instruction.READ, bytes([address, count])).data


def write(servo: int, address: int, values: bytes) -> bytes:
    """Return a command that writes bytes to a servo's memory. The servo answers."""
    return Packet(servo, Instruction.WRITE, bytes([address]) + values).data


def sync_read(servos: Sequence[int], address: int, count: int) -> bytes:
    """Return a request for bytes of several servos' memories. Servos answer in this order."""
    parameters = bytes([address, count, *servos])
    return Packet(BROADCAST, Instruction.SYNC_READ, parameters).data


def sync_write(address: int, values: Mapping[int, bytes]) -> bytes:
    """Return a command that writes to several servos' memories. No servo answers.

    Args:
        address: First address.
        values: Bytes for each servo, by id. All have the same length.
    """
    count = len(next(iter(values.values())))
    body = b"".join(bytes([servo]) + each for servo, each in values.items())
    return Packet(BROADCAST, Instruction.SYNC_WRITE, bytes([address, count]) + body).data


def take_packets(received: bytearray) -> list[Packet]:
    """Remove all whole packets from received bytes and return them. Drops damaged bytes.

    If a checksum is wrong, only the first byte of the packet is dropped, because a byte may have
    been lost and the next packet may begin inside this one.
    """
    found = list[Packet]()
    while (begin := received.find(HEADER)) >= 0:
        del received[:begin]
        if len(received) < 4:
            return found
        length = received[3]
        if received[2] == 0xFF or not 2 <= length <= _LONGEST:
            del received[0]
            continue
        if len(received) < length + 4:
            return found
        servo, code, *rest = received[2], received[4], *received[5 : length + 4]
        packet = Packet(servo, code, bytes(rest[:-1]))
        if packet.data == received[: length + 4]:
            found.append(packet)
            del received[: length + 4]
        else:
            del received[0]
    del received[: -1 if received.endswith(b"\xff") else len(received)]
    return found
