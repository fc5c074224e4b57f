"""What is known of a failure: its code, and the node, joint, value and limit it concerns."""

import sys

from executive.codes import CANCELED, INTERNAL, look_up

from .goal import Cause

# What errors call what was wrong, and what it is held against.
_VALUES = ("value", "distance")
_LIMITS = ("limit", "margin", "timeout")


def cause_of(error: Exception, node: str = "", message: str = "") -> Cause:
    """The cause that an error is.

    Args:
        error: What failed; whatever it knows of joint, value and limit is kept.
        node: Path of the node where it did; empty where it did outside the tree.
        message: In words, where they are others than the error's own.
    """
    code = getattr(error, "code", INTERNAL)
    known = look_up(code)
    said = message or str(error)
    return Cause(
        code=code,
        message=f"{known.heading}: {said}" if known.heading else said,
        node=node or str(getattr(error, "node", None) or ""),
        joint=str(getattr(error, "joint", "")),
        value=_number(error, _VALUES),
        limit=_limit(error),
        hint=str(getattr(error, "hint", "")) if code != INTERNAL else known.hint,
    )


CANCELED_CAUSE = Cause(CANCELED, look_up(CANCELED).heading, hint=look_up(CANCELED).hint)


def _number(error: Exception, names: tuple[str, ...]) -> float | None:
    """The first of these that the error has, where it is a finite number."""
    value = next((getattr(error, name) for name in names if hasattr(error, name)), None)
    fits = isinstance(value, (int, float)) and abs(value) <= sys.float_info.max
    return float(value) if fits and value is not None else None


def _limit(error: Exception) -> float | None:
    """The limit that a value has passed, of two the one on its side."""
    value = _number(error, _VALUES)
    lower, upper = _number(error, ("lower",)), _number(error, ("upper",))
    if value is None or lower is None or upper is None:
        return _number(error, _LIMITS)
    return lower if value < lower else upper
