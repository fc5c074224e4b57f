"""Limits the connections of a server, so that descriptors remain for the arm and for a stop."""

import os
import resource

from executive.errors import TooFewFiles

MAX_CONNECTIONS = 128  # enough for all streams, subscribers and rosbridge clients together
# Descriptors opened later (measured): the port, the recordings of the server and of a goal, a
# compaction, starts of planners, and a connection that is accepted before another one is closed.
_RESERVED = 16
_PER_PLANNER = 2


def max_connections(planners: int) -> int:
    """Return the largest number of served connections. The same number may wait.

    Call this before the server opens its first connection.

    Args:
        planners: Number of planner processes.

    Raises:
        TooFewFiles: The limit of the operating system leaves no descriptors for connections.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    others = len(os.listdir("/proc/self/fd")) + _RESERVED + _PER_PLANNER * planners
    room = MAX_CONNECTIONS if limit == resource.RLIM_INFINITY else (limit - others) // 2
    if room < 1:
        raise TooFewFiles(limit, others + 2, others + 2 * MAX_CONNECTIONS)
    return min(MAX_CONNECTIONS, room)
