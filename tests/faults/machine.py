"""How busy the machine is while a row runs, so that a limit of time says something of armtree.

As a program it measures until its standard input ends, in a session of its own, and prints a line
per sample: the time, by how much it woke too late [s], and the number of runnable threads.
"""

import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import NamedTuple, Self

EVERY_S = 0.01


class Busy(NamedTuple):
    """What a machine does to a program that does nothing wrong.

    Attributes:
        delay: 99th percentile of the time by which an idle program woke too late [s].
        slowdown: Runnable threads per processor, and at least 1: a program that computes takes so
            many times as long.
    """

    delay: float
    slowdown: float


class Machine:
    """Measures until it is closed."""

    def __init__(self) -> None:
        self._samples: list[tuple[float, float, int]] = []
        self._process = subprocess.Popen(
            [sys.executable, "-I", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            when, late, running = line.split()
            self._samples.append((float(when), float(late), int(running)))

    def between(self, begin: float, end: float) -> Busy:
        """How busy it was between two times [s, monotonic]."""
        samples = [each for each in tuple(self._samples) if begin <= each[0] <= end]
        late = sorted(each[1] for each in samples) or [0.0]
        running = statistics.fmean(each[2] for each in samples) if samples else 0.0
        cores = len(os.sched_getaffinity(0))
        return Busy(late[-(len(late) // 100) - 1], max(1.0, running / cores))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Measure no longer."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.close()
        self._process.wait(10)
        self._reader.join()
        self._process.stdout.close()


def main() -> None:
    """Print samples until standard input ends."""
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    while True:
        due = time.monotonic() + EVERY_S
        time.sleep(EVERY_S)  # noqa: TID251, how late it returns is what is measured
        now = time.monotonic()
        running = Path("/proc/loadavg").read_text().split()[3].partition("/")[0]
        print(f"{now:.6f} {now - due:.6f} {int(running) - 1}", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
