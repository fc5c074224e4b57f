"""The class of each code, with the exit status, the HTTP status, the meaning and the hint."""

from hardware import ArmtreeError, InternalError

from .api.codes import OK


def look_up(code: str) -> type[ArmtreeError]:
    """Return the error class of a code, or that of its family if no class has the code."""
    if code not in ArmtreeError.by_code:
        load_errors()
    family = code.partition(".")[0]
    names = (code, family, f"{family}.error", f"{family}.failed", InternalError.code)
    return next(ArmtreeError.by_code[name] for name in names if name in ArmtreeError.by_code)


def exit_status(code: str) -> int:
    """Return the exit status of a command that ends with a code."""
    return 0 if code == OK else look_up(code).exit_status


def load_errors() -> None:
    """Load the error classes of all packages, also of `skills`. Each class registers itself."""
    import executive.errors
    import executive.fleet.errors  # noqa: F401
    import hardware.drivers.servo_errors  # noqa: F401
    import logs.errors  # noqa: F401
    import skills.errors
    import skills.motion.errors  # noqa: F401
    import trees.errors  # noqa: F401


def meaning(kind: type[ArmtreeError]) -> str:
    """Return the meaning of an error class: the first sentence of its docstring."""
    return " ".join((kind.__doc__ or "").split()).partition(". ")[0].rstrip(".")
