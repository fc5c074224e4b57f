"""Checks and limits the memory of processes (`ulimit -v`), and checks the free memory."""

import resource
from contextlib import suppress
from pathlib import Path

from skills.motion.errors import TooLittleMemory

# Address space that armtree needs [bytes]. A planner of the shipped arm uses a quarter of it. The
# process that starts planners uses up to 0.8 GiB, mostly reserved for its threads (measured).
NEEDED = 2**30
_NEEDED_DATA = 2**29  # part of NEEDED that is data; a run uses 0.2 GiB (measured) [bytes]
_MOST = 4 * 2**30  # largest memory of a planner [bytes]


def check_memory() -> None:
    """Check that this process and its planners may use enough memory.

    Raises:
        TooLittleMemory: The operating system allows less memory than armtree needs.
    """
    if (limit := _limit()) < NEEDED:
        raise TooLittleMemory(limit, NEEDED)
    data, _ = resource.getrlimit(resource.RLIMIT_DATA)
    if data != resource.RLIM_INFINITY and data < _NEEDED_DATA:
        raise TooLittleMemory(data, _NEEDED_DATA, "data", "ulimit -d")


def limit_memory() -> None:
    """Limit the address space of this process to 4 GiB, or to a lower limit of the system."""
    limit = _limit()
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def has_spare_memory(file: Path = Path("/proc/meminfo")) -> bool:
    """Return True if the computer has enough free memory to load a world once more."""
    with suppress(OSError):
        for line in file.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024 >= NEEDED
    return False


def _limit() -> int:
    allowed = resource.getrlimit(resource.RLIMIT_AS)
    return min([_MOST, *(limit for limit in allowed if limit != resource.RLIM_INFINITY)])
