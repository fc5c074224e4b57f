"""What this process takes of the machine."""

import os
import threading
from pathlib import Path


def memory_used() -> float:
    """Of this process, resident [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def threads_used() -> int:
    """Threads but those that still finish a recording."""
    return sum(thread.name != "recording" for thread in threading.enumerate())


def descriptors_used() -> int:
    """Open descriptors but those of recordings."""
    links = (Path("/proc/self/fd") / name for name in os.listdir("/proc/self/fd"))
    return sum(not _target(link).endswith((".mcap", ".part")) for link in links)


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:  # it was the one that listed them
        return ".part"
