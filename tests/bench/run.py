"""How soon a run begins.

`cold_start_s`: from the start of the process to the first frame on the wire, less the configured
boot wait. `help_s`: how long `armtree --help` takes.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# A file beside this one is named like a room, and this folder comes first when run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

from hardware import load_robot
from tests.bench.table import Row, arguments, show

ARMTREE = [sys.executable, "-P", "-m", "executive"]


def cold_start() -> float:
    """One run of task 1 on the virtual Arduino [s]."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*ARMTREE, "run", "1", "--port", "virtual", "--json", "--recordings", folder]
        begun = time.monotonic()
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout
            events = [json.loads(line) for line in process.stdout]
    # Both processes read one monotonic clock.
    first: float = next(event["time_s"] for event in events if event["event"] == "sent")
    return first - begun - load_robot().serial.boot_wait


def help_time() -> float:
    """One `armtree --help` [s]."""
    begun = time.monotonic()
    subprocess.run([*ARMTREE, "--help"], stdout=subprocess.DEVNULL, check=True)
    return time.monotonic() - begun


def main(runs: int, file: Path | None) -> None:
    """Measure and show."""
    help_time()  # compiles what is not compiled yet
    rows = [
        Row("cold_start_s", "s", [cold_start() for _ in range(runs)], at_most=0.35),
        Row("help_s", "s", [help_time() for _ in range(runs)], at_most=0.12),
    ]
    show(rows, file)


if __name__ == "__main__":
    given = arguments(__doc__ or "").parse_args()
    main(given.runs, given.json)
