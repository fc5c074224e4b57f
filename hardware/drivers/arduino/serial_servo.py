"""The driver for servos on an Arduino that takes frames such as `b090,s090,e090,g000,`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hardware.drivers.firmware import Firmware
from hardware.drivers.pacing import unread_bytes
from hardware.joints import Joint
from hardware.link.link import Link
from hardware.link.serial_link import SerialLink
from hardware.toml_table import TomlTable

from .frames import Codec, WireField, servo_angle
from .virtual.arduino import VirtualLink

VIRTUAL = "virtual"

# The published sketch, built by avr-gcc 5.4.0 with Arduino's core and Servo library (as of 2026)
# and run on simavr, takes 5.058 ms a degree: delay(5) and Servo.write, which divides. A turn takes
# 0.12 ms more (atoi, and Servo.read twice) and the reading of its five bytes 0.03 ms. The figures
# here are higher by what the resonator of an Uno may be slow, 0.5 %. 10 Hz leaves 100 ms a frame,
# which 4 servos and 15 degrees need; frames of more come slower.
STOCK = Firmware("stock", 10.0, 0.0051, 16, 63, 1.0, b"", turn_time=0.00015)
# The same largest step: it bounds how far the arm still moves after a stop.
ARMTREE = Firmware(
    "armtree", 50.0, 0.0, 16, 255, 1.0, b"armtree 1 AVW? ", letters="bseg", baud=115200
)

FIRMWARES = {firmware.name: firmware for firmware in (STOCK, ARMTREE)}


@dataclass(frozen=True)
class SerialServo:
    """The published sketch's wire format, on the published sketch and on our firmware."""

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """The profiles there are."""
        return FIRMWARES

    def wire(self, joint: TomlTable, lower: float, upper: float) -> WireField:
        """Read a joint's field of the frame."""
        table = joint.table("wire")
        letter = table.text("letter")
        if len(letter) != 1 or not ("a" <= letter <= "z"):
            table.fail("letter", f"{letter!r} is not one letter from a to z")
        field = WireField(
            letter=letter,
            sign=table.integer("sign", choices=(-1, 1)),
            offset=math.radians(table.number("offset_deg")),
            span=math.radians(table.number("span_deg", above=0)),
            reversed=table.boolean("reversed"),
        )
        table.done()
        for limit in (lower, upper):
            if not _travels(field, limit):
                what = f"the URDF's limit {limit:g} rad is no servo angle from 0 to 180 degrees"
                joint.fail("wire", f"{what} with this field")
        return field

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Letters tell joints apart, the board knows them, and a stop fits its ring."""
        _check_letters(root.table("joints"), joints)
        codec = Codec(joints)
        if firmware.letters not in ("", codec.letters):
            knows = f"{firmware.name} has servos {_listed(firmware.letters)}, in this order"
            what = f"{knows}; the joints here have {_listed(codec.letters)}"
            root.table("serial").fail(
                "firmware", f"{what}. Change those, or flash another firmware"
            )
        frame = codec.frame([0] * len(joints))
        if unread_bytes(frame, waiting=1) > firmware.ring:
            what = f"frames of {len(joints)} joints are too long for the {firmware.ring} bytes"
            root.fail("joints", f"{what} that {firmware.name} can hold; a stop would not fit")

    def wire_format(self, joints: Sequence[Joint]) -> Codec:
        """The codec of these joints."""
        return Codec(joints)

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> Link:
        """A serial port, or the virtual Arduino."""
        if port != VIRTUAL:
            return SerialLink(port, baud)
        return VirtualLink(Codec(joints).letters, _boot_angles(joints), firmware, baud)


def _boot_angles(joints: Sequence[Joint]) -> tuple[int, ...]:
    return Codec(joints).encode([joint.boot for joint in joints]).servos


def _travels(field: WireField, limit: float) -> bool:
    """Whether a limit [rad] is an angle that a frame can hold and a servo can turn to."""
    try:
        return 0 <= servo_angle(field, limit) <= 180
    except (ArithmeticError, ValueError):  # an endless limit, or next to no span
        return False


def _listed(letters: str) -> str:
    return ", ".join(letters)


def _check_letters(table: TomlTable, joints: Sequence[Joint]) -> None:
    taken: dict[str, str] = {}
    for joint in joints:
        assert isinstance(joint.wire, WireField)
        letter = joint.wire.letter
        if letter in taken:
            what = f"its letter {letter} on the wire is that of {taken[letter]} already"
            table.fail(joint.name, what)
        taken[letter] = joint.name
