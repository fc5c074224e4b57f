"""Stops and cancels, on a thread of their own: they never wait for other requests."""

import asyncio
import logging
from concurrent.futures import Future, ThreadPoolExecutor

from executive.api.outcome import CancelResult
from executive.executive import Executive

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
        self._stop: Future[CancelResult] | None = None

    async def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel goals, as `Executive.cancel` does.

        Stops of the arm that arrive before the previous one has begun share its result.
        """
        stops = not (identity or stamp_ns)
        pending = self._stop if stops else None
        if pending is None or pending.running() or pending.done():
            pending = self._thread.submit(self._executive.cancel, identity, stamp_ns)
            self._stop = pending if stops else self._stop
        answer = await asyncio.shield(asyncio.wrap_future(pending))
        if stops and not answer.goals and self._log_bucket.take():
            logger.info("Received a stop of the arm; no goal was under way")
        return answer

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown()
