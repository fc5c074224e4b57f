"""What a failure is called: every code's words and exit status, as one table."""

from dataclasses import dataclass

OK = "ok"
CANCELED = "goal.canceled"
INTERNAL = "internal"

INTERRUPTED_EXIT = 130  # left by a second Ctrl-C


@dataclass(frozen=True, slots=True)
class Code:
    """Words and exit status.

    Attributes:
        heading: What is said before the causes; empty where a cause says it all.
        exit: Status of the process.
        meaning: For the documentation.
    """

    heading: str
    exit: int
    meaning: str


# A code is looked up whole, then by what stands before its dot.
CODES = {
    OK: Code("", 0, "done"),
    INTERNAL: Code("A bug of ours", 1, "a bug of ours"),
    "file": Code("", 3, "a task, subtree or robot file is wrong"),
    "goal": Code("", 4, "the goal was refused"),
    "goal.out_of_bounds": Code(
        "Target position out of boundaries", 4, "a target lies outside its joint's limits"
    ),
    "goal.bad_target": Code("The target makes no sense", 4, "a target names the wrong joints"),
    CANCELED: Code("Canceled", 7, "canceled"),
    "plan": Code("One or more planners failed", 5, "no motion was found"),
    "plan.timeout": Code("One or more planners failed", 8, "a planner ran out of time"),
    "plan.motion_collides": Code(
        "The motion would collide as its frames play it", 5, "the final check refused the frames"
    ),
    "plan.start_moved": Code("", 5, "the arm was moved after it was planned"),
    "hw": Code("", 6, "the hardware failed"),
    "hw.no_port": Code("", 3, "no serial port was named"),
    "hw.port_busy": Code("", 9, "somebody else has the port"),
    "log": Code("", 10, "the recording is incomplete"),
    "log.unreadable": Code("", 3, "a file is no recording that can be read"),
    "log.truncated": Code("", 3, "the end of a recording is missing"),
}


def look_up(code: str) -> Code:
    """The entry of a code, or of its family."""
    return CODES.get(code) or CODES.get(code.partition(".")[0]) or CODES[INTERNAL]
