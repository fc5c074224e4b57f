"""The client for programs that use asyncio; its methods are those of `Client`, awaited."""

import asyncio
import json
import uuid
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING, Any, Self, TypeVar

from executive.goals.events import Status, event_from_json
from executive.goals.outcome import CancelResult, GoalStatus, Outcome
from executive.server.token_file import KEEPALIVE

from . import requests
from .errors import GoalFailed, Refused, ServerUnreachable
from .replies import check, reached
from .requests import OpenQuestion, Request, Task
from .synchronous import ANSWER_TIMEOUT, BEAT_PERIOD, NOTHING, SILENCE_TIMEOUT

if TYPE_CHECKING:
    from executive.goals.events import Event

T = TypeVar("T")


class AsyncClient:
    """A server, as an asyncio program sees it. Use it as an asynchronous context.

    Args:
        url: As of `Client`.
        token: As of `Client`.
    """

    def __init__(self, url: str | None = None, token: str | None = None) -> None:
        import httpx  # takes longer than all the rest

        address = requests.address(url, token)
        self.url = address.url
        self._http = httpx.AsyncClient(
            base_url=address.url,
            headers=address.headers,
            timeout=ANSWER_TIMEOUT,
            transport=httpx.AsyncHTTPTransport(trust_env=False, socket_options=KEEPALIVE),
            trust_env=False,
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *raised: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close its connections; goals go on."""
        await self._http.aclose()

    async def run(self, task: int, deadman: bool = False, **arguments: Any) -> Outcome:
        """Run a task and wait until it is done.

        Raises:
            GoalFailed: It was not done; `outcome` says why.
        """
        if deadman:
            goal_id = uuid.uuid4().hex
            async with self.hold(goal_id):
                await self.send(task, arguments, goal_id, deadman=True)
                outcome = await self.result(goal_id)
        else:
            outcome = await self.result(await self.send(task, arguments))
        if not outcome.success:
            raise GoalFailed(outcome)
        return outcome

    async def send(
        self,
        task: int,
        arguments: Mapping[str, Any] = NOTHING,
        goal_id: str = "",
        deadman: bool = False,
    ) -> str:
        """Send a goal, and return its identity at once."""
        return await self._do(requests.send(task, arguments, goal_id, deadman))

    async def result(self, goal_id: str, timeout: float | None = None) -> Outcome:
        """Wait for the outcome of a goal [s]."""
        for seconds in requests.waits(timeout):
            try:
                return await self._do(requests.result(goal_id, seconds))
            except Refused as error:
                if error.code != requests.NOT_YET:
                    raise
        raise requests.not_ended(goal_id, timeout)

    async def goal(self, goal_id: str) -> GoalStatus:
        """What a goal is at."""
        return await self._do(requests.goal(goal_id))

    async def goals(self) -> tuple[GoalStatus, ...]:
        """All goals that are known."""
        found: tuple[GoalStatus, ...] = ()
        while page := await self._do(requests.goals(found)):
            found = page + found
        return found

    async def cancel(self, goal_id: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel a goal, those accepted until a time [ns since 1970], both, or all."""
        return await self._do(requests.cancel(goal_id, stamp_ns))

    async def stop(self) -> CancelResult:
        """Stop the arm, and cancel all goals. This is no emergency stop."""
        return await self._do(requests.stop())

    async def pause(self, goal_id: str) -> GoalStatus:
        """Stop the arm and keep the goal."""
        return await self._do(requests.change(goal_id, "pause"))

    async def resume(self, goal_id: str) -> GoalStatus:
        """Go on with a paused goal."""
        return await self._do(requests.change(goal_id, "resume"))

    async def step(self, goal_id: str) -> GoalStatus:
        """Let one node of a paused goal begin."""
        return await self._do(requests.change(goal_id, "step"))

    async def break_at(self, node: str, on: bool = True) -> tuple[str, ...]:
        """Have every goal pause before a node, by its path, or no longer; returns all such."""
        return await self._do(requests.break_at(node, on))

    async def questions(self) -> tuple[OpenQuestion, ...]:
        """What tasks ask now."""
        return await self._do(requests.questions())

    async def answer(self, question_id: str, words: str) -> str:
        """Answer a question; returns the answer that counts, which is the first."""
        return await self._do(requests.answer(question_id, words))

    async def arm(self, transition: str, pose: str | None = None) -> str:
        """Take the arm through a transition, as `Client.arm` does; activating moves it."""
        return await self._do(requests.arm(transition, pose))

    async def status(self) -> Status:
        """What the arm and the goals are at."""
        return await self._do(requests.status())

    async def tasks(self) -> tuple[Task, ...]:
        """The tasks there are."""
        return await self._do(requests.tasks())

    @asynccontextmanager
    async def events(self, *kinds: str) -> AsyncIterator[AsyncIterator["Event"]]:
        """Watch what happens; first comes what still holds of the goal under way."""
        query = {"events": ",".join(kinds)} if kinds else {}
        with reached(self.url):
            async with self._http.stream(
                "GET", "/api/events", params=query, timeout=SILENCE_TIMEOUT
            ) as response:
                if response.is_error:
                    await response.aread()
                check(response)
                lines = response.aiter_lines()
                await anext(lines, None)  # says that we watch
                yield self._read(lines)

    @asynccontextmanager
    async def hold(self, goal_id: str) -> AsyncIterator[None]:
        """Hold a goal that is sent within a second: it is canceled when this context ends."""
        released = asyncio.Event()

        async def beats() -> AsyncIterator[bytes]:
            while not released.is_set():
                yield b"."
                with suppress(TimeoutError):
                    await asyncio.wait_for(released.wait(), BEAT_PERIOD)

        async def hold() -> None:
            with suppress(ServerUnreachable), reached(self.url):
                await self._http.post(f"/api/goals/{goal_id}/hold", content=beats())

        holding = asyncio.create_task(hold())
        try:
            yield
        finally:
            released.set()
            await holding

    async def _read(self, lines: AsyncIterator[str]) -> AsyncIterator["Event"]:
        with reached(self.url, SILENCE_TIMEOUT):
            async for line in lines:
                if line.startswith("data: "):
                    yield event_from_json(json.loads(line.removeprefix("data: ")))

    async def _do(self, ask: Request[T]) -> T:
        with reached(self.url):
            response = await self._http.request(
                ask.method,
                ask.path,
                json=ask.body,
                params=ask.query,
                timeout=ANSWER_TIMEOUT + ask.patience,
            )
        check(response)
        return ask.read(response.json())
