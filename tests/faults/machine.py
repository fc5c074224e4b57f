"""How busy the machine is before a fault, so that a limit of time says something of armtree.

As a program, in a session of its own, it prints what it has measured.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

SECONDS = 1.0
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


def measured() -> Busy:
    """Measure for `SECONDS`. No fault may be under way: it would extend its own limit."""
    command = [sys.executable, "-I", __file__]
    program = subprocess.run(command, check=True, stdout=subprocess.PIPE, start_new_session=True)
    return Busy(*json.loads(program.stdout))


def main() -> None:
    late, running = list[float](), list[int]()
    end = time.monotonic() + SECONDS
    while (begin := time.monotonic()) < end:
        time.sleep(EVERY_S)  # noqa: TID251, how late it returns is what is measured
        late.append(time.monotonic() - begin - EVERY_S)
        running.append(int(Path("/proc/loadavg").read_text().split()[3].partition("/")[0]) - 1)
    delay = sorted(late)[-(len(late) // 100) - 1]
    slowdown = max(1.0, statistics.fmean(running) / len(os.sched_getaffinity(0)))
    print(json.dumps(Busy(delay, slowdown)))  # noqa: T201


if __name__ == "__main__":
    main()
