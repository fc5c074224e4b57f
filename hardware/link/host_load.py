"""How busy this computer is: a busy one delays threads, also those of the kernel that move bytes.

Bytes of a pseudo-terminal or a USB adapter then arrive late, as if a cable were loose.
"""

import os
from pathlib import Path


def busy_words() -> str:
    """Return words for a busy computer, and what to do."""
    ready, processors = _ready_threads(), _processors()
    many = f", with {ready} threads ready to run on {processors} processors"
    return f"the computer is busy{many if ready > processors else ''}; end other programs"


def or_busy() -> str:
    """Return a sentence for the end of a message about a delay; empty if the computer has time."""
    return f". Or {busy_words()}" if _ready_threads() > _processors() else ""


def _processors() -> int:
    return len(os.sched_getaffinity(0))


def _ready_threads() -> int:
    """Return how many threads of this computer run or could run now (`man 5 proc_loadavg`)."""
    return int(Path("/proc/loadavg").read_text().split()[3].partition("/")[0])
