"""The Arduinobot with bus servos in place of its own."""

import re
from pathlib import Path

from hardware import load_robot

_SERIAL = """[serial]
port = "virtual"
baud = 1000000
boot_wait_s = 1.0
firmware = "{}"

"""


def bus_arm(folder: Path, series: str = "sts") -> Path:
    """Writes the robot file and its URDF, and returns the robot file. Ids count from 1."""
    shipped = load_robot()
    text = shipped.path.read_text().replace('driver = "serial_servo"', 'driver = "feetech"')
    text = re.sub(r"\[serial\]\n.*?\n\n", _SERIAL.format(series), text, flags=re.S)
    ids = iter(range(1, 5))
    text = re.sub(
        r"wire = .*", lambda _: f"wire = {{ id = {next(ids)}, sign = 1, offset_deg = 0 }}", text
    )
    (folder / "arm.toml").write_text(text)
    (folder / shipped.urdf.name).write_bytes(shipped.urdf.read_bytes())
    return folder / "arm.toml"
