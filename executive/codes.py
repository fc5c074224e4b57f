"""What a failure is called: every code's words and exit status, as one table."""

from dataclasses import dataclass

OK = "ok"
CANCELED = "goal.canceled"
INTERNAL = "internal"
DIFFERS = "replay.differs"

USAGE_EXIT = 2  # as click has it
INTERRUPTED_EXIT = 130  # left by Ctrl-C before a goal had begun, or by a second one


@dataclass(frozen=True, slots=True)
class Code:
    """Words and exit status.

    Attributes:
        heading: What is said before the causes; empty where a cause says it all.
        exit: Status of the process.
    """

    heading: str
    exit: int


# A code is looked up whole, then by what stands before its dot.
CODES = {
    OK: Code("", 0),
    INTERNAL: Code("A bug of ours", 1),
    "file": Code("", 3),
    "goal": Code("", 4),
    "goal.out_of_bounds": Code("Target position out of boundaries", 4),
    "goal.bad_target": Code("The target makes no sense", 4),
    CANCELED: Code("Canceled", 7),
    "plan": Code("One or more planners failed", 5),
    "plan.timeout": Code("One or more planners failed", 8),
    "plan.motion_collides": Code("The motion would collide as its frames play it", 5),
    "plan.start_moved": Code("", 5),
    "hw": Code("", 6),
    "hw.no_port": Code("", 3),
    "hw.port_busy": Code("", 9),
    "task": Code("The task failed", 11),
    "task.timeout": Code("The task failed", 8),
    DIFFERS: Code("", 12),
    "log": Code("", 10),
    "log.unreadable": Code("", 3),
    "log.truncated": Code("", 3),
}


def look_up(code: str) -> Code:
    """The entry of a code, or of its family."""
    return CODES.get(code) or CODES.get(code.partition(".")[0]) or CODES[INTERNAL]
