"""The endpoints of the HTTP interface: one method per row of `operations`, with the row's name."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from json import dumps
from pathlib import Path
from types import MappingProxyType
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response, StreamingResponse

from executive.api.events import Event, event_to_json
from executive.api.move import Move
from executive.api.outcome import GoalStatus, Outcome
from executive.api.schemas import MAX_LISTED
from executive.errors import BadRequest, NotFound, NotHeld, ResultTimeout, TooMuch
from executive.executive import Executive
from executive.goals.breakpoints import check_node
from executive.goals.moves.poses import listed_poses, save_where
from executive.goals.questions import Questions
from executive.server.errors import refusal
from executive.server.event_hub import EventHub
from executive.server.limits.cancel_thread import CancelThread
from executive.server.metrics import Metrics
from executive.server.page.robot_shapes import RobotScene
from executive.server.security import is_authenticated
from executive.server.sign_in import SignIn
from trees.live_library import LiveLibrary
from trees.writing.saved_poses import remove_pose

from .recording_endpoints import RecordingEndpoints

MAX_SUBSCRIBERS = 16  # limit for clients with the token; the same limit for clients without it
HOLD_SECONDS = 1.0  # time without data after which a hold ends [s]

Json = Mapping[str, Any]
_NO_ARGUMENTS: Json = MappingProxyType({})


class Endpoints(RecordingEndpoints):
    """Answers requests by calling the executive.

    A method receives the checked parameters and body of its row as arguments. For a row that
    streams, it also receives the request. A method returns JSON, the data of another media type, or
    a whole response.

    Args:
        executive: Runs the goals.
        canceler: Cancels goals and stops the arm.
        hub: Source of events.
        questions: Open questions of tasks.
        sign_in: Signs browsers in.
    """

    has_arm = True

    def __init__(
        self,
        executive: Executive,
        canceler: CancelThread,
        hub: EventHub,
        questions: Questions,
        sign_in: SignIn,
    ) -> None:
        super().__init__(executive.setup.recordings, sign_in, executive.clock)
        self._executive, self._canceler = executive, canceler
        self._hub, self._questions = hub, questions
        assert isinstance(executive.library, LiveLibrary)  # see `Setup.reload`
        self._library = executive.library
        self._scene = RobotScene(executive.robot)
        self._metrics = Metrics(executive.status, lambda: len(hub.subscribers))
        self._listing, self._planning = asyncio.Lock(), asyncio.Lock()
        self._ended: dict[str, asyncio.Future[Outcome]] = {}
        self._held: dict[str, asyncio.Event] = {}
        hub.listeners += [self._metrics.count, self._wake]

    async def robot(self) -> Json:
        return await asyncio.to_thread(self._scene.description)

    async def mesh(self, digest: str) -> bytes:
        found = await asyncio.to_thread(self._executive.world_mesh, digest)
        if found is not None:
            return found
        try:
            return await asyncio.to_thread(self._scene.mesh, digest)
        except NotFound:
            return await super().mesh(digest)

    async def status(self) -> Json:
        return self._executive.status().to_json()

    async def where(self) -> Json:
        return self._executive.where().to_json()

    async def tasks(self) -> Json:
        async with self._listing:
            return {"tasks": await asyncio.to_thread(self._library.listed)}

    async def nodes(self, task: int) -> Json:
        return {"nodes": await asyncio.to_thread(self._library.nodes, task)}

    async def poses(self) -> Json:
        def read() -> list[tuple[str, Mapping[str, float], str]]:
            return list(listed_poses(self._executive.robot, self._library.latest))

        found = await asyncio.to_thread(read)
        return {"poses": [{"pose": n, "positions": p, "source": s} for n, p, s in found]}

    async def save_pose(self, name: str, group: str = "arm", replace: bool = False) -> Json:
        executive = self._executive
        path, positions = await asyncio.to_thread(
            save_where, executive.robot, executive.where(), self._own_folder, name, group, replace
        )
        return {"pose": name, "positions": positions, "source": str(path)}

    async def remove_pose(self, name: str) -> Json:
        path = await asyncio.to_thread(remove_pose, self._executive.robot, self._own_folder, name)
        return {"pose": name, "source": str(path)}

    @property
    def _own_folder(self) -> Path:
        """The user's folder, or the one that the first saved pose creates."""
        return self._library.folder or self._executive.setup.own_trees

    async def goals(self, limit: int | None = None, before: int | None = None) -> Json:
        newest = MAX_LISTED if limit is None else limit
        found = self._executive.goals(newest if before is None else None)
        if before is not None:
            found = tuple(goal for goal in found if goal.stamp_ns < before)[-newest:]
        return {"goals": [goal.to_json() for goal in found]}

    async def send(
        self,
        task: float | str,
        arguments: Json = _NO_ARGUMENTS,
        goal_id: str = "",
        deadman: bool = False,
        stops: int | None = None,
        client: str = "",
    ) -> Json | Response:
        number, texts = await self._number(task), _as_texts(arguments)
        return await self._accept(number, texts, goal_id, deadman, stops, client)

    async def plan(self, task: float | str, arguments: Json = _NO_ARGUMENTS) -> Json:
        number, texts = await self._number(task), _as_texts(arguments)
        async with self._planning:
            found = await asyncio.to_thread(self._executive.dry_run, number, texts)
        return {"events": [*map(event_to_json, found.events)], "unknown": found.unknown}

    async def _number(self, task: float | str) -> int:
        if isinstance(task, str):
            return await asyncio.to_thread(lambda: self._library.latest.number(task))
        return int(task)

    async def move(
        self,
        to: Sequence[str | float],
        relative: bool = False,
        speed: float = 1.0,
        goal_id: str = "",
        deadman: bool = False,
        stops: int | None = None,
        client: str = "",
    ) -> Json | Response:
        move = Move(tuple(map(str, to)), relative, speed)
        return await self._accept(move, {}, goal_id, deadman, stops, client)

    async def _accept(
        self,
        task: int | Move,
        texts: Mapping[str, str],
        goal_id: str,
        deadman: bool,
        stops: int | None,
        client: str,
    ) -> Json | Response:
        if deadman and not await self._is_held(goal_id):
            raise NotHeld(goal_id)
        send = self._executive.send_and_record
        acceptance = await asyncio.to_thread(send, task, texts, goal_id, client, stops)
        if acceptance.cause:
            return refusal(acceptance.cause)
        held = self._held.get(goal_id)
        if deadman and not (held and held.is_set()):  # the hold ended before the goal was accepted
            await self._canceler.cancel(goal_id)
        return acceptance.to_json()

    async def goal(self, goal_id: str) -> Json:
        return self._executive.goal(goal_id).to_json()

    async def result(self, request: Request, goal_id: str, timeout: float | None = None) -> Json:
        outcome = self._executive.goal(goal_id).outcome
        if outcome is None:
            ended = self._ended.setdefault(goal_id, asyncio.get_running_loop().create_future())
            if not await _before_leaving(request, asyncio.shield(ended), timeout):
                raise ResultTimeout(goal_id, timeout or 0.0)
            outcome = ended.result()  # the executive may have forgotten the goal meanwhile
        return {"goal_id": goal_id, **outcome.to_json()}

    async def hold(self, request: Request, goal_id: str) -> Json:
        held = self._held.setdefault(goal_id, asyncio.Event())
        if held.is_set():
            raise BadRequest(f"goal {goal_id} is held already")
        held.set()
        try:
            await _read_to_end(request)
        finally:
            del self._held[goal_id]
            answer = await asyncio.shield(self._canceler.cancel(goal_id))
        return {"goal_id": goal_id, "canceled": goal_id in answer.goals}

    async def cancel_goal(self, goal_id: str, stamp_ns: float = 0) -> Json:
        return await self.cancel(goal_id, stamp_ns)

    async def cancel(self, goal_id: str = "", stamp_ns: float = 0) -> Json:
        return (await self._canceler.cancel(goal_id, int(stamp_ns))).to_json()

    async def stop(self) -> Json:
        return (await self._canceler.cancel()).to_json()

    async def pause(self, goal_id: str) -> Json:
        return await self._change(self._executive.pause, goal_id)

    async def resume(self, goal_id: str) -> Json:
        return await self._change(self._executive.resume, goal_id)

    async def step(self, goal_id: str) -> Json:
        return await self._change(self._executive.step, goal_id)

    async def break_at(self, node: str, on: bool = True) -> Json:
        if on:
            await asyncio.to_thread(check_node, self._library, node)
        self._executive.break_at(node, on)
        return {"breakpoints": self._executive.status().breakpoints}

    async def questions(self) -> Json:
        waiting = [
            {"question_id": each.question_id, "text": each.text, "choices": each.choices}
            for each in self._questions.open()
        ]
        return {"questions": waiting}

    async def answer(self, question_id: str, answer: str) -> Json:
        counts = self._questions.answer(question_id, answer)
        return {"question_id": question_id, "answer": counts}

    async def arm(self, transition: str, pose: str | None = None, stops: int | None = None) -> Json:
        state = await asyncio.to_thread(self._executive.arm_to, transition, pose, stops)
        return {"arm": state.value}

    async def events(self, request: Request, events: str = "") -> Response:
        known = is_authenticated(request.scope)
        if sum(each.authenticated is known for each in self._hub.subscribers) >= MAX_SUBSCRIBERS:
            raise TooMuch(f"{MAX_SUBSCRIBERS} clients watch already", "close one of them")
        stream = self._stream(frozenset(filter(None, events.split(","))), known)
        return StreamingResponse(stream, media_type="text/event-stream")

    async def metrics(self) -> bytes:
        return self._metrics.text()

    async def _stream(self, kinds: frozenset[str], known: bool) -> AsyncIterator[bytes]:
        subscriber = self._hub.subscribe(kinds, known)
        try:
            yield b": armtree\n\n"  # shows the client that it is connected
            while text := await subscriber.take():
                yield text
        finally:
            self._hub.subscribers.discard(subscriber)

    async def _change(self, act: Callable[[str], None], goal_id: str) -> Json:
        await asyncio.to_thread(act, goal_id)
        return self._executive.goal(goal_id).to_json()

    async def _is_held(self, goal_id: str) -> bool:
        """Return True if a client holds a goal. The hold may arrive after the goal."""
        held = self._held.setdefault(goal_id, asyncio.Event())
        try:
            await asyncio.wait_for(held.wait(), HOLD_SECONDS)
        except TimeoutError:
            if self._held.get(goal_id) is held and not held.is_set():
                del self._held[goal_id]
        return held.is_set() and goal_id in self._held

    def _wake(self, event: Event) -> None:
        if isinstance(event, GoalStatus) and event.outcome:
            ended = self._ended.pop(event.identity, None)
            if ended:
                ended.set_result(event.outcome)


def _as_texts(arguments: Json) -> dict[str, str]:
    """Return values as text for a task file, because JSON is valid YAML."""
    return {
        name: value if isinstance(value, str) else dumps(value) for name, value in arguments.items()
    }


async def _read_to_end(request: Request) -> None:
    """Read a body until it ends, its client leaves, or no data arrives for `HOLD_SECONDS`."""
    chunks = aiter(request.stream())
    try:
        while True:
            await asyncio.wait_for(anext(chunks), HOLD_SECONDS)
    except (StopAsyncIteration, TimeoutError, ClientDisconnect):
        return


async def _before_leaving(request: Request, wanted: Any, timeout: float | None) -> bool:
    """Wait for an awaitable. Return False if the time [s] is over or the client left first."""
    waiting, leaving = asyncio.ensure_future(wanted), asyncio.ensure_future(_left(request))
    done, _ = await asyncio.wait(
        (waiting, leaving), timeout=timeout, return_when=asyncio.FIRST_COMPLETED
    )
    for each in (waiting, leaving):
        each.cancel()
    return waiting in done


async def _left(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
