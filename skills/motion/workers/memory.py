"""The address space that a process may use, which `ulimit -v` limits, and the memory left."""

import resource
from contextlib import suppress
from pathlib import Path

from skills.motion.errors import TooLittleMemory

# A planner of the shipped arm uses a quarter of it. The process that starts planners uses up to
# 0.8 GiB of it, mostly reserved for its threads (measured) [bytes].
NEEDED = 2**30
_MOST = 4 * 2**30  # what a planner may use at most [bytes]


def check_memory() -> None:
    """Check that this process and its planners can work.

    Raises:
        TooLittleMemory: The operating system allows less address space than `NEEDED`.
    """
    if (limit := _limit()) < NEEDED:
        raise TooLittleMemory(limit, NEEDED)


def limit_memory() -> None:
    """Limit this process's memory to the planner's bound, or to the system's if that is lower."""
    limit = _limit()
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def has_spare_memory(file: Path = Path("/proc/meminfo")) -> bool:
    """Return True if the computer has memory left for a planner that may not be needed."""
    with suppress(OSError):
        for line in file.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024 >= NEEDED
    return False


def _limit() -> int:
    allowed = resource.getrlimit(resource.RLIMIT_AS)
    return min([_MOST, *(limit for limit in allowed if limit != resource.RLIM_INFINITY)])
