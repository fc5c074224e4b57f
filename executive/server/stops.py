"""Stops and cancels: they wait for no other request, and the network waits for none of them."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

from executive.executive import Executive
from executive.goals import CancelAnswer


class Stops:
    """Asks the executive to cancel, on a thread that does nothing else.

    Args:
        executive: Which.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive = executive
        self._thread = ThreadPoolExecutor(1, "stop")

    async def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelAnswer:
        """Cancel goals, as `Executive.cancel` does."""
        loop = asyncio.get_running_loop()
        cancel = self._executive.cancel
        return await loop.run_in_executor(self._thread, cancel, identity, stamp_ns)

    def close(self) -> None:
        """Let the thread go."""
        self._thread.shutdown()
