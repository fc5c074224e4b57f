"""The answers: each operation of the table as a method, on top of the executive."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from json import dumps
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from executive.errors import BadRequest, NotHeld, ResultTimeout, TooMuch
from executive.executive import Event, Executive
from executive.goals.events import KINDS, as_goal, as_result, as_status
from executive.goals.goal import GoalStatus, Outcome
from executive.goals.questions import Questions
from executive.goals.queue import CancelAnswer
from executive.live_library import LiveLibrary
from executive.server.event_hub import EventHub
from executive.server.limits.cancel_thread import CancelThread
from executive.server.metrics import Metrics
from executive.server.security import HAS_TOKEN

from .errors import status_of
from .openapi import document
from .operations import LISTED

MAX_SUBSCRIBERS = 16  # of those who show the token, and of all others
HOLD_SECONDS = 1.0  # a hold of which nothing comes for so long has ended


@dataclass(frozen=True, slots=True)
class Call:
    """What was asked.

    Attributes:
        request: As Starlette has it.
        given: The parameters in the address, as they are declared.
        body: The JSON object that was sent; empty where none was.
    """

    request: Request
    given: Mapping[str, Any]
    body: Mapping[str, Any]

    @property
    def known(self) -> bool:
        """Whether whoever asks shows the token."""
        return HAS_TOKEN in self.request.scope["state"]


class Api:
    """The executive, as its clients on the network see it.

    Args:
        executive: Which.
        stops: What cancels its goals.
        library: The tasks there are.
        hub: Where its events arrive.
        questions: What its tasks ask.
    """

    def __init__(
        self,
        executive: Executive,
        stops: CancelThread,
        library: LiveLibrary,
        hub: EventHub,
        questions: Questions,
    ) -> None:
        self._executive, self._stops = executive, stops
        self._library, self._hub, self._questions = library, hub, questions
        self._metrics = Metrics(executive.snapshot, lambda: len(hub.subscribers))
        self._document = document()
        self._listing = asyncio.Lock()
        self._ended: dict[str, asyncio.Future[Outcome]] = {}
        self._held: dict[str, asyncio.Event] = {}
        hub.listeners += [self._metrics.watch, self._wake]

    async def health(self, _: Call) -> Response:
        """Whether the server answers."""
        return JSONResponse({"ok": True, "version": version("armtree")})

    async def status(self, _: Call) -> Response:
        """What the arm and the goals are at."""
        return JSONResponse(as_status(self._executive.snapshot()))

    async def tasks(self, _: Call) -> Response:
        """The tasks there are."""
        async with self._listing:
            return JSONResponse({"tasks": await asyncio.to_thread(self._library.listed)})

    async def goals(self, call: Call) -> Response:
        """The newest goals, or the newest of those before."""
        newest, before = call.given.get("limit", LISTED), call.given.get("before")
        found = self._executive.goals(newest if before is None else None)
        if before is not None:
            found = tuple(goal for goal in found if goal.stamp_ns < before)[-newest:]
        return JSONResponse({"goals": [as_goal(goal) for goal in found]})

    async def send(self, call: Call) -> Response:
        """Accept a goal, or refuse it."""
        body, identity = call.body, call.body.get("goal_id", "")
        if body.get("deadman") and not await self._is_held(identity):
            raise NotHeld(identity)
        arguments = {name: _as_text(value) for name, value in body.get("arguments", {}).items()}
        acceptance = await asyncio.to_thread(
            self._executive.send_and_record, int(body["task"]), arguments, identity
        )
        if acceptance.cause:
            return JSONResponse(asdict(acceptance.cause), status_of(acceptance.code))
        held = self._held.get(identity)
        if body.get("deadman") and not (held and held.is_set()):  # let go before there was a goal
            await self._stops.cancel(identity)
        made = {"goal_id": acceptance.identity, "stamp_ns": acceptance.stamp_ns}
        return JSONResponse(made, 201)

    async def goal(self, call: Call) -> Response:
        """What a goal is at."""
        return JSONResponse(as_goal(self._executive.goal(call.given["goal_id"])))

    async def result(self, call: Call) -> Response:
        """How a goal ended; waits for it as long as the client does."""
        identity, seconds = call.given["goal_id"], call.given.get("timeout")
        outcome = self._executive.goal(identity).outcome
        if outcome is None:
            ended = self._ended.setdefault(identity, asyncio.get_running_loop().create_future())
            if not await _before_leaving(call.request, asyncio.shield(ended), seconds):
                raise ResultTimeout(identity, seconds or 0.0)
            outcome = ended.result()  # by now the goal may be forgotten
        return JSONResponse({"goal_id": identity, **as_result(outcome)})

    async def hold(self, call: Call) -> Response:
        """Keep a hand on a goal, until nothing more comes."""
        identity = call.given["goal_id"]
        held = self._held.setdefault(identity, asyncio.Event())
        if held.is_set():
            raise BadRequest(f"goal {identity} is held already")
        held.set()
        try:
            await _to_the_end(call.request)
        finally:
            del self._held[identity]
            answer = await asyncio.shield(self._stops.cancel(identity))
        return JSONResponse({"goal_id": identity, "canceled": identity in answer.goals})

    async def cancel_goal(self, call: Call) -> Response:
        """Cancel a goal, and with a stamp all that were accepted until then."""
        stamp_ns = int(call.body.get("stamp_ns", 0))
        return _canceled(await self._stops.cancel(call.given["goal_id"], stamp_ns))

    async def cancel(self, call: Call) -> Response:
        """Cancel all goals, or those that are named."""
        body = call.body
        return _canceled(
            await self._stops.cancel(body.get("goal_id", ""), int(body.get("stamp_ns", 0)))
        )

    async def stop(self, _: Call) -> Response:
        """Stop the arm, cancel all."""
        return _canceled(await self._stops.cancel())

    async def pause(self, call: Call) -> Response:
        """Stop the arm and keep the goal."""
        return await self._do(call, self._executive.pause)

    async def resume(self, call: Call) -> Response:
        """Go on with a goal."""
        return await self._do(call, self._executive.resume)

    async def step(self, call: Call) -> Response:
        """Let one node begin."""
        return await self._do(call, self._executive.step)

    async def break_at(self, call: Call) -> Response:
        """Have every goal pause before a node, or no longer."""
        node, on = call.body["node"], call.body.get("on", True)
        if on:
            await asyncio.to_thread(self._library.check_node, node)
        self._executive.break_at(node, on)
        return JSONResponse({"breakpoints": self._executive.snapshot().breakpoints})

    async def questions(self, _: Call) -> Response:
        """What tasks ask now."""
        waiting = [
            {"question_id": each.question_id, "text": each.text, "choices": each.choices}
            for each in self._questions.open()
        ]
        return JSONResponse({"questions": waiting})

    async def answer(self, call: Call) -> Response:
        """Answer a question."""
        identity = call.given["question_id"]
        counts = self._questions.answer(identity, call.body["answer"])
        return JSONResponse({"question_id": identity, "answer": counts})

    async def arm(self, call: Call) -> Response:
        """Take the arm through its lifecycle."""
        asked = call.given["transition"], call.body.get("pose")
        state = await asyncio.to_thread(self._executive.arm_to, *asked)
        return JSONResponse({"arm": state.value})

    async def events(self, call: Call) -> Response:
        """What happens, as it happens."""
        if sum(each.known is call.known for each in self._hub.subscribers) >= MAX_SUBSCRIBERS:
            raise TooMuch(f"{MAX_SUBSCRIBERS} watch already", "close one of them")
        kinds = frozenset(filter(None, call.given.get("events", "").split(",")))
        if kinds - KINDS:
            raise BadRequest(f"events are {', '.join(sorted(KINDS))}", status=422)
        return StreamingResponse(self._watched(kinds, call.known), media_type="text/event-stream")

    async def metrics(self, _: Call) -> Response:
        """Figures for Prometheus."""
        return Response(self._metrics.text(), media_type="text/plain; version=0.0.4")

    async def openapi(self, _: Call) -> Response:
        """The document."""
        return JSONResponse(self._document)

    async def _watched(self, kinds: frozenset[str], known: bool) -> AsyncIterator[bytes]:
        subscriber = self._hub.subscribe(kinds, known)
        try:
            yield b": armtree\n\n"  # so that the client knows it is connected
            while text := await subscriber.take():
                yield text
        finally:
            self._hub.subscribers.discard(subscriber)

    async def _do(self, call: Call, act: Callable[[str], None]) -> Response:
        identity = call.given["goal_id"]
        await asyncio.to_thread(act, identity)
        return JSONResponse(as_goal(self._executive.goal(identity)))

    async def _is_held(self, identity: str) -> bool:
        """Whether somebody holds a goal; the hand and the goal may come in either order."""
        held = self._held.setdefault(identity, asyncio.Event())
        try:
            await asyncio.wait_for(held.wait(), HOLD_SECONDS)
        except TimeoutError:
            if self._held.get(identity) is held and not held.is_set():
                del self._held[identity]
        return held.is_set() and identity in self._held

    def _wake(self, event: Event) -> None:
        if isinstance(event, GoalStatus) and event.outcome:
            ended = self._ended.pop(event.identity, None)
            if ended:
                ended.set_result(event.outcome)


def _as_text(value: Any) -> str:
    """A value as it would stand in a file; JSON is YAML."""
    return value if isinstance(value, str) else dumps(value)


def _canceled(answer: CancelAnswer) -> Response:
    return JSONResponse({"return_code": answer.code.value, "goals": list(answer.goals)})


async def _to_the_end(request: Request) -> None:
    """Read a body until it ends, its client leaves, or nothing comes for too long."""
    chunks = aiter(request.stream())
    try:
        while True:
            await asyncio.wait_for(anext(chunks), HOLD_SECONDS)
    except (StopAsyncIteration, TimeoutError, ClientDisconnect):
        return


async def _before_leaving(request: Request, wanted: Any, seconds: float | None) -> bool:
    """Wait for something; False where the time is up [s] or the client has gone."""
    waiting, leaving = asyncio.ensure_future(wanted), asyncio.ensure_future(_left(request))
    done, _ = await asyncio.wait(
        (waiting, leaving), timeout=seconds, return_when=asyncio.FIRST_COMPLETED
    )
    for each in (waiting, leaving):
        each.cancel()
    return waiting in done


async def _left(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
