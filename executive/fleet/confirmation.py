"""Answers of arms to a request."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Confirmation:
    """The answer of an arm to a request.

    Attributes:
        arm: POOL.NAME.
        error: Error of the request; empty if it is done.
        goals: Goals that the request concerned.
        seconds: Time from the request to the answer [s].
    """

    arm: str
    error: str
    goals: tuple[str, ...]
    seconds: float
