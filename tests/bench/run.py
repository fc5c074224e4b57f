"""How soon a run begins, and how long short commands take.

`cold_start_s`: from the start of the process to the first frame on the wire, less the configured
boot wait. `so101_cold_start_s`: to the first motion of an SO-101. Its servos need no wait, but its
planner loads meshes. `help_s`: how long `armtree --help` takes; the other rows are named like their
commands. `status` and `stop` ask a server on this machine that is idle.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# A file beside this one is named like a room, and this folder comes first when run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

from hardware import load_robot
from tests.bench.table import Row, arguments, show

ARMTREE = [sys.executable, "-P", "-m", "armtree"]
# As on a user's machine, armtree is compiled once. Some images of containers forbid this.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def time_to_first(event: str, *words: str) -> float:
    """Time from the start of a run on a virtual arm to its first event of a kind [s]."""
    with tempfile.TemporaryDirectory() as folder:
        options = ("--port", "virtual", "--json", "--recordings", folder)
        begun = time.monotonic()
        with subprocess.Popen(
            [*ARMTREE, "run", *words, *options], stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout
            events = [json.loads(line) for line in process.stdout]
    # Both processes read one monotonic clock.
    time_s: float = next(one["time_s"] for one in events if one["event"] == event)
    return time_s - begun


@contextmanager
def serving(folder: str) -> Iterator[str]:
    """The address of a server with the virtual Arduino."""
    command = [*ARMTREE, "serve", "--port", "virtual", "--tcp-port", "0", "--recordings", folder]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr
        try:
            yield next(url for line in server.stderr for url in re.findall(r"http://[\d.:]+", line))
        finally:
            server.terminate()


def command_time(*words: str) -> float:
    """One command [s]."""
    begun = time.monotonic()
    subprocess.run([*ARMTREE, *words], stdout=subprocess.DEVNULL, check=True)
    return time.monotonic() - begun


def main(runs: int, file: Path | None) -> None:
    """Measure and show."""
    with tempfile.TemporaryDirectory() as folder, serving(folder) as url:
        commands: dict[str, tuple[str, ...]] = {
            "help_s": ("--help",),
            "tasks_s": ("tasks",),
            "status_s": ("status", "--server", url),
            "stop_s": ("stop", "--server", url),
            "log_ls_s": ("log", "ls", folder),
        }
        rows = []
        for name, words in commands.items():
            command_time(*words)  # compiles what is not compiled yet
            at_most = 0.12 if name == "help_s" else 0.25
            rows.append(Row(name, "s", [command_time(*words) for _ in range(runs)], at_most))
    boot = load_robot().serial.boot_wait
    started = [time_to_first("sent", "1") - boot for _ in range(runs)]
    moved = [time_to_first("schedule", "home", "--robot", "so101") for _ in range(runs)]
    cold = Row("cold_start_s", "s", started, at_most=0.35), Row("so101_cold_start_s", "s", moved)
    show([*cold, *rows], file)


if __name__ == "__main__":
    given = arguments(__doc__ or "").parse_args()
    main(given.runs, given.json)
