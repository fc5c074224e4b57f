"""The time a plan has, and where it went."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hardware import Clock

from .errors import BadQuery, PlanTimeout, shown
from .measures import is_number


class Deadline:
    """When the time of a request is up.

    Args:
        clock: The time.
        timeout: From now [s].

    Raises:
        BadQuery: The time-out is no number, or a NaN, which would never be over.
    """

    def __init__(self, clock: Clock, timeout: float) -> None:
        if not is_number(timeout, -math.inf, math.inf):
            raise BadQuery(f"The time-out is {shown(timeout)} s; give a number")
        self._clock, self._timeout = clock, min(max(timeout, -1.0), sys.float_info.max)
        self._end = clock.now() + self._timeout

    @property
    def over(self) -> bool:
        """Whether it has passed."""
        return self._clock.now() > self._end

    def check(self) -> None:
        """Go on.

        Raises:
            PlanTimeout: The time is up.
        """
        if self.over:
            raise PlanTimeout(self._timeout)


class Stopwatch:
    """What each rung took, with what led to it, from now on; together they are all the time.

    Attributes:
        milliseconds: By rung, in the order of their first time [ms].
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._since = clock, clock.now()
        self.milliseconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what is done inside; a rung may be climbed more than once."""
        try:
            yield
        finally:
            now = self._clock.now()
            spent = 1e3 * (now - self._since)
            self.milliseconds[name] = self.milliseconds.get(name, 0.0) + spent
            self._since = now
