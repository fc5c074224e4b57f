"""What every caller sees, here and over the network: codes, outcomes, events and operations."""

from enum import StrEnum

ADDRESS = "127.0.0.1"  # default address of a server: programs on this machine only
PORT = 8765  # default TCP port of a server
NATS_PORT = 4222  # of a fleet
POOL = "arms"  # default pool of an arm


class Policy(StrEnum):
    """What happens to a goal that arrives while another one is under way."""

    REJECT = "reject"
    QUEUE = "queue"
    PREEMPT = "preempt"
