"""How many connections a server may keep, so that descriptors remain for the arm and for a stop."""

import os
import resource

from executive.errors import TooFewFiles

MAX_CONNECTIONS = 128  # more than all streams, subscribers and rosbridge clients together
# What is opened later: the port, the recordings of the server and of a goal, a compaction, what
# starts planners, and a connection that is accepted before another one is closed (measured).
_RESERVED = 16
_PER_PLANNER = 2


def max_connections(planners: int) -> int:
    """Return how many connections a server may keep, while as many wait to be served.

    Call it before the server opens its first one.

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
