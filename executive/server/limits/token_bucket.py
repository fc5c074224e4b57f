"""How often something may be asked."""

from collections.abc import Callable


class TokenBucket:
    """Lets so many through at once, and then so many a second.

    Args:
        rate: How many a second.
        burst: How many at once.
        now: The time [s].
    """

    def __init__(self, rate: float, burst: float, now: Callable[[], float]) -> None:
        self._rate, self._burst, self._now = rate, burst, now
        self._left, self._at = burst, now()

    def take(self) -> bool:
        """Whether one more may pass."""
        now = self._now()
        self._left = min(self._burst, self._left + (now - self._at) * self._rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
