"""The deadline of a request, and the durations of its stages."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hardware import Clock

from .errors import BadQuery, MotionError, PlanTimeout, shown
from .validation import is_number


class Deadline:
    """The deadline of a request.

    Args:
        clock: Time source.
        timeout: Time from now [s].

    Raises:
        BadQuery: The timeout is not a number or is NaN, so the deadline would never pass.
    """

    def __init__(self, clock: Clock, timeout: float) -> None:
        if not is_number(timeout, -math.inf, math.inf):
            raise BadQuery(f"The timeout is {shown(timeout)} s; give a number")
        self._clock, self._timeout = clock, min(max(timeout, -1.0), sys.float_info.max)
        self._end = clock.now() + self._timeout

    @property
    def over(self) -> bool:
        """True if the deadline has passed."""
        return self._clock.now() > self._end

    def check(self) -> None:
        """Check the deadline.

        Raises:
            PlanTimeout: The deadline passed.
        """
        if self.over:
            raise PlanTimeout(self._timeout)


class Stopwatch:
    """Measures the durations of stages. Time between two stages counts for the second one.

    The first stage starts when the object is created.

    Args:
        clock: Time source.

    Attributes:
        milliseconds: Duration of each stage, in the order in which they first ended [ms].
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._since = clock, clock.now()
        self.milliseconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the `with` block. A stage may run more than once; its durations are added.

        An error that ends a stage gets the durations of all stages so far.
        """
        try:
            yield
        except MotionError as error:
            error.milliseconds = self.milliseconds
            raise
        finally:
            now = self._clock.now()
            spent = 1e3 * (now - self._since)
            self.milliseconds[name] = self.milliseconds.get(name, 0.0) + spent
            self._since = now
