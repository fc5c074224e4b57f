"""The profiles of the firmwares for an Arduino: the published sketch and armtree's own."""

from dataclasses import replace
from pathlib import Path

from hardware.drivers.firmware_profile import Firmware, Words
from hardware.loading.dataclass import dataclass

# File that avrdude writes to a board, for `firmware = "armtree"`.
HEX_FILE = Path(__file__).parent / "firmware" / "armtree.hex"


@dataclass(frozen=True, slots=True)
class ArduinoFirmware(Firmware):
    """The profile of a firmware for an Arduino.

    Attributes:
        banner: First bytes of the line that the board sends after booting; empty if it sends
            nothing. The line ends with the frame that the board holds, which a reset does not
            change. A firmware with a banner also acknowledges frames; see `firmware/README.md`.
        letters: Letters of the fields of a frame, in order; empty if they depend on the robot.
    """

    banner: bytes = b""
    letters: str = ""


_WORDS = Words(
    board="Arduino",
    unit="degrees",
    start_pose="boot pose",
    reset_effect="moves to its boot pose",
    advice_outside=(
        "clear the space around the arm and switch the board off and on, so that it goes to its "
        "boot pose"
    ),
)

# The published sketch turns one servo after the other in steps of one degree, a first step of zero
# degrees included, waits about 5 ms after each, and reads nothing meanwhile. Built by avr-gcc 5.4.0
# with Arduino's core and Servo library (as of 2026) and run on simavr, it needs 5.058 ms a degree:
# delay(5) and Servo.write, which divides. Each turn takes another 0.12 ms (atoi, and Servo.read
# twice), and reading its five bytes 0.03 ms. The figures here are 0.5 % higher, because the
# resonator of an Uno may be that slow. 10 Hz leaves 100 ms per frame, enough for 4 servos and 15
# degrees in total; larger frames are sent at a lower rate.
STOCK = ArduinoFirmware(
    "stock",
    rate=10.0,
    max_step=16,
    boot_time=1.0,
    ring=63,
    unit_time=0.0051,
    turn_time=0.00015,
    words=_WORDS,
)
# The firmware of armtree stores a frame, and timers move the servos. A frame therefore needs only
# its time on the line. `max_step` is the same as for the sketch: it bounds the motion after a stop.
ARMTREE = ArduinoFirmware(
    "armtree",
    rate=50.0,
    max_step=16,
    boot_time=1.0,
    baud=115200,
    ring=255,
    reports_pose=True,
    words=replace(_WORDS, reset_effect="stays where it is"),
    banner=b"armtree 1 AVW? ",
    letters="bseg",
)

FIRMWARES = {firmware.name: firmware for firmware in (STOCK, ARMTREE)}
