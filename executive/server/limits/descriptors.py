"""Limits the connections of a server, so that descriptors remain for the arm and for a stop."""

from executive.setup import spare_files

MAX_CONNECTIONS = 128  # enough for all streams, subscribers and rosbridge clients together


def max_connections(planners: int) -> int:
    """Return the largest number of served connections. The same number may wait.

    Call this before the server opens its first connection.

    Args:
        planners: Number of planner processes.

    Raises:
        HostLimit: The limit of the operating system leaves no descriptors for connections.
    """
    return spare_files(planners, least=2, most=2 * MAX_CONNECTIONS) // 2
