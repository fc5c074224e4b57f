"""Stops and cancels: they wait for no other request, and the network waits for none of them."""

import asyncio
import logging
from concurrent.futures import ThreadPoolExecutor

from executive.executive import Executive
from executive.goals.queue import CancelAnswer
from hardware import Clock

from .token_bucket import TokenBucket

logger = logging.getLogger(__name__)


class CancelThread:
    """Asks the executive to cancel, on a thread that does nothing else.

    Args:
        executive: Which.
        clock: Whose time.
    """

    def __init__(self, executive: Executive, clock: Clock) -> None:
        self._executive = executive
        self._said = TokenBucket(0.1, 3.0, clock.now)  # strangers must not fill the log
        self._thread = ThreadPoolExecutor(1, "stop")

    async def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelAnswer:
        """Cancel goals, as `Executive.cancel` does."""
        loop = asyncio.get_running_loop()
        cancel = self._executive.cancel
        answer = await loop.run_in_executor(self._thread, cancel, identity, stamp_ns)
        if not (identity or stamp_ns or answer.goals) and self._said.take():
            logger.info("Received a stop of the arm; no goal was under way")
        return answer

    def close(self) -> None:
        """Let the thread go."""
        self._thread.shutdown()
