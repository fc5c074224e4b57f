"""The API of the executive, local and over the network: codes, outcomes, events, operations."""

from enum import StrEnum

ADDRESS = "127.0.0.1"  # default address of a server: programs on this machine only
PORT = 8765  # default TCP port of a server
NATS_PORT = 4222  # default TCP port of a fleet
POOL = "arms"  # default pool of an arm


class Policy(StrEnum):
    """Policy for a goal that arrives while another one is under way."""

    REJECT = "reject"
    QUEUE = "queue"
    PREEMPT = "preempt"
