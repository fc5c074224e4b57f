"""Where things are in a checkout."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
ROBOT_FILE = ROOT / "hardware" / "robots" / "arduinobot" / "arduinobot.toml"
FIRMWARE = ROOT / "hardware" / "drivers" / "arduino" / "firmware"
TASKS = ROOT / "trees" / "tasks"
EXAMPLES = ROOT / "trees" / "examples"
PEERS = ROOT / "tests" / "peers"
