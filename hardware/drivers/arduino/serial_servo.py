"""The driver for servos on an Arduino that takes frames such as `b090,s090,e090,g000,`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hardware.description.joints import Joint
from hardware.description.robot import Robot
from hardware.description.toml_table import TomlTable
from hardware.drivers.firmware import FIRMWARES, Firmware
from hardware.link.link import Link
from hardware.link.serial_link import SerialLink

from .frames import Codec, WireField, servo_angle
from .pacing import unread_bytes
from .virtual.arduino import VirtualLink
from .virtual.board import Board

VIRTUAL = "virtual"


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


def virtual_board(robot: Robot) -> Board:
    """The model of the board that a robot description names."""
    letters, angles = Codec(robot.actuated).letters, _boot_angles(robot.actuated)
    return Board(letters, angles, robot.firmware, robot.serial.baud)


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
