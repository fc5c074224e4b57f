"""Several errors of ours in a group, as they are and as one."""

from collections.abc import Sequence
from typing import TypeVar

from hardware import HardwareError

from .errors import OutOfBounds, SkillError
from .motion.errors import MotionError

Ours = SkillError | MotionError | HardwareError
Cause = TypeVar("Cause", bound=Exception)


def causes_of(raised: BaseException) -> list[Ours]:
    """The errors of ours that something raised is, or holds; none where it holds others too."""
    if isinstance(raised, Ours):
        return [raised]
    if not isinstance(raised, ExceptionGroup):
        return []
    found = [causes_of(each) for each in raised.exceptions]
    return [error for each in found for error in each] if all(found) else []


def as_one(errors: Sequence[Cause]) -> Cause:
    """The first error, by preference one that knows joint and limit, with the words of all.

    Args:
        errors: At least one.
    """
    if len(errors) == 1:
        return errors[0]
    first = next((error for error in errors if isinstance(error, OutOfBounds)), errors[0])
    first.args = ("; ".join(dict.fromkeys(map(str, errors))),)
    return first
