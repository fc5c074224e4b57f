"""What a code means: the exit status, the words and the hint of every failure.

An exception class carries its own code, exit status and hint, and its docstring begins with the
meaning. This table has the codes that no exception carries.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

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

# Cheap ones first: a code is searched in one module after the other.
_MODULES = (
    "executive.errors",
    "executive.fleet.errors",
    "hardware.errors",
    "hardware.drivers.servo_errors",
    "logs.errors",
    "trees.errors",
    "skills.errors",
    "skills.motion.errors",
)


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

# What describes an unknown code of a family, if it is not FAMILY or FAMILY.error.
_FAMILIES = {"task": "task.failed", "replay": DIFFERS}


_FOUND = dict(ROWS)  # a walk through all classes takes up to 0.1 ms


def look_up(code: str) -> Code:
    """Return the meaning of a code, or of its family if no class with that code is loaded."""
    family = code.partition(".")[0]
    for name in (code, family, f"{family}.error", _FAMILIES.get(family, "")):
        if found := _find(name):
            return found
    return ROWS[INTERNAL]


def _find(code: str) -> Code | None:
    """Return the meaning of exactly this code. A class with this code may be loaded later."""
    # The search ends at the class, so that it loads no more rooms than it must.
    if code not in _FOUND and (kind := next((c for c in _classes() if c.code == code), None)):
        _FOUND[code] = _describe(kind)
    return _FOUND.get(code)


def all_codes() -> dict[str, Code]:
    """Return every code of armtree, sorted."""
    return dict(sorted((ROWS | {kind.code: _describe(kind) for kind in _own_classes()}).items()))


def _own_classes() -> Iterator[Any]:
    """Yield the exception classes of armtree that have a code of their own."""
    for name in _MODULES:
        for kind in vars(import_module(name)).values():
            own = isinstance(kind, type) and kind.__module__ == name
            if own and "code" in vars(kind):
                yield kind


def _classes() -> Iterator[Any]:
    """Yield the classes of `_own_classes`, then their subclasses in users' drivers and skills."""
    seen = []
    for kind in _own_classes():
        seen.append(kind)
        yield kind
    for kind in seen:
        for derived in kind.__subclasses__():
            if derived not in seen and "code" in vars(derived):
                seen.append(derived)
                yield derived


def _describe(kind: Any) -> Code:
    meaning = " ".join((kind.__doc__ or "").split()).partition(". ")[0].rstrip(".")
    return Code(kind.exit_status, meaning, kind.hint, getattr(kind, "heading", ""))
