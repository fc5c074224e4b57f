"""The driver for servos on an Arduino that receives frames such as `b090,s090,e090,g000,`."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hardware.drivers.firmware_profile import Firmware
from hardware.drivers.pacing import unread_bytes
from hardware.joints import Joint
from hardware.link.link import Link
from hardware.loading.dataclass import dataclass
from hardware.toml_table import TomlTable

from .firmware_profile import FIRMWARES, ArduinoFirmware
from .frames import ANGLE_MAX, Codec, WireField, servo_angle

if TYPE_CHECKING:
    from .acknowledgements import Acknowledgements
    from .virtual.board import Board


@dataclass(frozen=True, slots=True)
class SerialServo:
    """The driver. The published sketch and the firmware of armtree use the same wire format."""

    @property
    def firmwares(self) -> Mapping[str, Firmware]:
        """The published sketch and the firmware of armtree."""
        return FIRMWARES

    def wire(self, joint: TomlTable, lower: float, upper: float) -> WireField:
        """Read the encoding of a joint in a frame from the key `wire` of its table."""
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
            if not _is_servo_angle(field, limit):
                what = f"the URDF's limit {limit:g} rad is not a servo angle from 0 to 180 degrees"
                joint.fail("wire", f"{what} with this field")
        return field

    def check(self, root: TomlTable, joints: Sequence[Joint], firmware: Firmware) -> None:
        """Check that letters are unique and known, and that a stop fits into the buffer."""
        _check_letters(root.table("joints"), joints)
        codec = Codec(joints)
        assert isinstance(firmware, ArduinoFirmware)
        if firmware.letters not in ("", codec.letters):
            knows = f"{firmware.name} has servos {', '.join(firmware.letters)}, in this order"
            what = f"{knows}; the joints here have {', '.join(codec.letters)}"
            root.table("serial").fail(
                "firmware", f"{what}. Change the letters, or flash another firmware"
            )
        frame = codec.frame([0] * len(joints))
        if unread_bytes(frame, waiting=1) > firmware.ring:
            what = f"frames of {len(joints)} joints are too long for the {firmware.ring} bytes"
            root.fail("joints", f"{what} that {firmware.name} can store; a stop would not fit")

    def wire_format(self, joints: Sequence[Joint], firmware: Firmware) -> Codec:
        """Return the wire format of these joints."""
        return Codec(joints)

    def protocol(
        self, joints: Sequence[Joint], firmware: Firmware, robot_file: Path
    ) -> "Acknowledgements":
        """Return the protocol of a firmware. The published sketch acknowledges no frames."""
        from .acknowledgements import Acknowledgements  # a list of tasks does not need it

        assert isinstance(firmware, ArduinoFirmware)
        return Acknowledgements(Codec(joints), firmware, FIRMWARES.values(), robot_file)

    def link(self, joints: Sequence[Joint], firmware: Firmware, baud: int, port: str) -> Link:
        """Return a link over a serial port."""
        from hardware.link.serial_link import SerialLink  # slow to import

        return SerialLink(port, baud)

    def model(self, joints: Sequence[Joint], firmware: Firmware, baud: int) -> "Board":
        """Return a model of an Arduino with its program."""
        from .virtual.board import Board  # only a virtual board needs it

        codec = Codec(joints)
        boot_angles = codec.encode([joint.boot for joint in joints]).servos
        return Board(codec.letters, boot_angles, firmware, baud)


def _is_servo_angle(field: WireField, limit: float) -> bool:
    """Return True if a position limit [rad] encodes to a servo angle from 0 to 180 degrees."""
    try:
        return 0 <= servo_angle(field, limit) <= ANGLE_MAX
    except (ArithmeticError, ValueError):  # an infinite limit, or a span near 0
        return False


def _check_letters(table: TomlTable, joints: Sequence[Joint]) -> None:
    taken: dict[str, str] = {}
    for joint in joints:
        assert isinstance(joint.wire, WireField)
        letter = joint.wire.letter
        if letter in taken:
            what = f"its letter {letter} is already the letter of {taken[letter]}"
            table.fail(joint.name, what)
        taken[letter] = joint.name
