"""Limits of the operating system on this process, checked before an arm is opened."""

import os
import resource

from hardware import HostLimit

# Descriptors that are opened later (measured): the port, the recordings of a session and of a goal,
# a compaction, the process from which planners are forked, with a start of another one, and a
# connection that is accepted before another one is closed.
_RESERVED = 20
_PER_PLANNER = 4  # two sockets, the output, and the process
_ADVISED = 1024  # smallest advised limit of open files


def check_host(planners: int) -> None:
    """Check that this process may open enough files for an arm and its planners.

    Args:
        planners: Number of planner processes.

    Raises:
        HostLimit: The operating system lets this process open too few files.
        FileNotFoundError: The working folder was deleted; `filename` is None.
    """
    os.getcwd()
    spare_files(planners)


def spare_files(planners: int, least: int = 0, most: int = 0) -> int:
    """Return the number of files that this process may open besides those of an arm.

    Args:
        planners: Number of planner processes.
        least: Smallest number that the caller needs.
        most: Largest number that the caller can use; the result is at most this.

    Raises:
        HostLimit: The limit of the operating system is too low for `least`.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    others = len(os.listdir("/proc/self/fd")) + _RESERVED + _PER_PLANNER * planners
    spare = most if limit == resource.RLIM_INFINITY else limit - others
    if spare < least:
        words = f"this process may open {limit} files, but armtree needs {others + least}"
        raise HostLimit(words, f"`ulimit -n {max(_ADVISED, others + most)}`")
    return min(most, spare)
