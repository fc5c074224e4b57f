"""Stops and cancels, on their own thread, so that they never wait for other requests."""

import asyncio
import logging
from concurrent.futures import Future, ThreadPoolExecutor

from executive.api.outcome import CancelResult
from executive.api.token_bucket import TokenBucket
from executive.executive import Executive

logger = logging.getLogger(__name__)


class CancelThread:
    """Cancels goals on a separate thread, so that the event loop never blocks.

    Args:
        executive: Runs the goals.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive = executive
        # Clients without the token must not fill the log.
        self._log_bucket = TokenBucket(0.1, 3.0, executive.clock.now)
        self._thread = ThreadPoolExecutor(1, "stop")
        self._stop: Future[CancelResult] | None = None
        self._stopped: asyncio.Future[CancelResult]

    def stop(self) -> asyncio.Future[CancelResult]:
        """Stop the arm and cancel all goals. Must be called in the event loop.

        Stops that arrive before the previous one has begun share its result. Do not cancel the
        result.
        """
        if self._stop is None or self._stop.running() or self._stop.done():
            self._stop = self._thread.submit(self._executive.cancel, "", 0)
            self._stopped = asyncio.wrap_future(self._stop)
            self._stopped.add_done_callback(self._log)
        return self._stopped

    async def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel goals like `Executive.cancel`."""
        if not (identity or stamp_ns):
            return await asyncio.shield(self.stop())
        pending = self._thread.submit(self._executive.cancel, identity, stamp_ns)
        return await asyncio.shield(asyncio.wrap_future(pending))

    def _log(self, stopped: asyncio.Future[CancelResult]) -> None:
        idle = not (stopped.cancelled() or stopped.exception() or stopped.result().goals)
        if idle and self._log_bucket.take():
            logger.info("Received a stop of the arm; no goal was under way")

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown()
