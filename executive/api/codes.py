"""The codes that no exception class carries, with their meaning. Each error class has its own."""

from dataclasses import dataclass

OK = "ok"
INTERNAL = "internal"
USAGE = "usage"
CANCELED = "goal.canceled"
BUSY = "goal.busy"
QUEUE_FULL = "goal.queue_full"
DUPLICATE = "goal.duplicate"
BAD_IDENTITY = "goal.bad_id"
DIFFERS = "replay.differs"
CLOSING = "server.closing"

INTERRUPTED_EXIT = 130  # Ctrl-C before the first goal, or pressed twice
READER_ENDED_EXIT = 141  # the shell's status of a program that SIGPIPE ends


@dataclass(frozen=True, slots=True)
class Code:
    """The meaning of a code.

    Attributes:
        exit_status: Status of the process.
        meaning: What happened.
        hint: What to do next; empty if there is nothing to do.
        heading: Text before the message of a cause; empty for none.
    """

    exit_status: int
    meaning: str
    hint: str
    heading: str = ""


ROWS = {
    OK: Code(0, "The task was done", ""),
    INTERNAL: Code(
        1, "A bug in armtree", "report it, with --debug and the recording", "A bug in armtree"
    ),
    USAGE: Code(2, "The command line is wrong", "see `armtree COMMAND --help`"),
    "file": Code(3, "A file is wrong", "correct it at the line that the message names"),
    CANCELED: Code(7, "The goal was canceled", "", "Canceled"),
    BUSY: Code(
        4,
        "Another goal is under way",
        "wait, or cancel it: `armtree cancel GOAL`, or `armtree stop`",
    ),
    QUEUE_FULL: Code(4, "The queue of goals is full", "wait for some, or cancel them"),
    DUPLICATE: Code(4, "Another goal has that identity", "give every goal its own identity"),
    BAD_IDENTITY: Code(
        4,
        "The identity of a goal is not 32 lower-case hexadecimal digits",
        "leave it out to get one",
    ),
    DIFFERS: Code(12, "A replay differs from its recording", "see where it differs"),
    "server": Code(13, "The server failed", "start it again"),
    CLOSING: Code(13, "The server is ending", "start it again"),
}
