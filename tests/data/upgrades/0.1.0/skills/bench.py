"""A skill of version 0.1.0."""

from skills import skill


@skill
def halve(length: float) -> float:
    """Return half of a length [m]."""
    return length / 2
