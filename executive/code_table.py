"""What a code means: the exit status, the words and the hint of every failure.

An error class carries its code, exit status and hint, and its docstring begins with the meaning.
"""

from hardware import ArmtreeError

from .api.codes import DIFFERS, INTERNAL, ROWS, Code

# What describes an unknown code of a family, if it is not FAMILY or FAMILY.error.
_FAMILIES = {"task": "task.failed", "replay": DIFFERS}


def look_up(code: str) -> Code:
    """Return the meaning of a code, or of its family if no class has that code."""
    if code not in ROWS and code not in ArmtreeError.by_code:
        load_errors()
    family = code.partition(".")[0]
    for name in (code, family, f"{family}.error", _FAMILIES.get(family, "")):
        if name in ROWS:
            return ROWS[name]
        if kind := ArmtreeError.by_code.get(name):
            return describe(kind)
    return ROWS[INTERNAL]


def load_errors() -> None:
    """Load the error classes of all rooms, also the slow `skills`: each registers itself."""
    import executive.errors
    import executive.fleet.errors  # noqa: F401
    import hardware.drivers.servo_errors  # noqa: F401
    import logs.errors  # noqa: F401
    import skills.errors
    import skills.motion.errors  # noqa: F401
    import trees.errors  # noqa: F401


def describe(kind: type[ArmtreeError]) -> Code:
    """Return the meaning of the code of an error class."""
    meaning = " ".join((kind.__doc__ or "").split()).partition(". ")[0].rstrip(".")
    return Code(kind.exit_status, meaning, kind.hint, kind.heading)
