"""A limit on the rate of events: a token bucket."""

from collections.abc import Callable


class TokenBucket:
    """Allows a burst, and then a constant rate.

    Args:
        rate: Allowed rate [1/s].
        burst: Allowed number at once.
        now: Callback that returns the time [s].
    """

    def __init__(self, rate: float, burst: float, now: Callable[[], float]) -> None:
        self._rate, self._burst, self._now = rate, burst, now
        self._tokens, self._updated = burst, now()

    def take(self) -> bool:
        """Take a token. Return False if there is none."""
        now = self._now()
        self._tokens = min(self._burst, self._tokens + (now - self._updated) * self._rate)
        self._updated = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
