"""Stops and cancels, on a thread of their own: they never wait for other requests."""

import asyncio
import logging
from concurrent.futures import ThreadPoolExecutor

from executive.executive import Executive
from executive.goals.outcome import CancelResult

from .token_bucket import TokenBucket

logger = logging.getLogger(__name__)


class CancelThread:
    """Cancels goals on a thread that does nothing else, so that the event loop never blocks.

    Args:
        executive: Runs the goals.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive = executive
        # Clients without the token must not fill the log.
        self._log_bucket = TokenBucket(0.1, 3.0, executive.clock.now)
        self._thread = ThreadPoolExecutor(1, "stop")

    async def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel goals, as `Executive.cancel` does."""
        loop = asyncio.get_running_loop()
        cancel = self._executive.cancel
        answer = await loop.run_in_executor(self._thread, cancel, identity, stamp_ns)
        if not (identity or stamp_ns or answer.goals) and self._log_bucket.take():
            logger.info("Received a stop of the arm; no goal was under way")
        return answer

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown()
