"""Answers calls of tools. It is a client of the arm's server."""

import asyncio
import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from mcp_types import ImageContent, TextContent

from executive.api.events import kind_of
from executive.api.move import Move
from executive.api.outcome import GoalStatus, cause_of
from executive.client.asynchronous import AsyncClient
from executive.client.held_goals import Connect, HeldGoals, Send
from executive.client.values import PlannedTask, Task
from executive.errors import NotExecuting, Refused, ServerLost, ServerUnreachable
from hardware import Robot, State
from hardware.printable import plural
from trees import UnknownTask

from .asking import Person
from .following import Waits, follow
from .tools import WAIT
from .words import arguments_schema, goal_words, run_lines

Content = list[TextContent | ImageContent]

_BY_HAND = (
    "-> only a person may activate the arm: ask the person to press Activate on the page "
    "(`armtree view`), or to type `armtree arm activate`"
)


class NotDone(Exception):
    """The goal of a call did not succeed. The message has the cause."""


class Calls:
    """One call of a tool. For each row of `TOOLS`, there is a method with the name of the row.

    Args:
        client: Client of the server.
        connect: Callback that returns another client, for a goal that outlives the call.
        held: The goals of this process.
        waits: The calls of this process that wait.
        person: The person behind the client.
        robot: Robot for drawings, or None.
    """

    def __init__(
        self,
        client: AsyncClient,
        connect: Connect,
        held: HeldGoals,
        waits: Waits,
        person: Person,
        robot: Robot | None,
    ) -> None:
        self._client, self._connect, self._held, self._waits = client, connect, held, waits
        self._person, self._robot = person, robot

    async def list_tasks(self) -> str:
        rows = [
            {"task": each.number, "name": each.name, "description": each.description}
            | {"arguments": [*each.inputs]}
            | ({"wrong": each.wrong} if each.wrong else {})
            for each in await self._client.tasks()
        ]
        return _lines(rows)

    async def describe_task(self, task: int | str) -> str:
        known = await self._client.tasks()
        found = next((each for each in known if task in (each.number, each.name)), None)
        if found is None:
            named = isinstance(task, str)
            raise UnknownTask(task, [each.name if named else each.number for each in known])
        return json.dumps(_described(found), indent=1, ensure_ascii=False)

    async def check_task(self, task: int | str, arguments: Mapping[str, Any] | None = None) -> str:
        return _plan_words(await self._client.plan(task, arguments))

    async def plan_task(
        self, task: int | str, arguments: Mapping[str, Any] | None = None
    ) -> Content:
        from .picture import picture  # slow to import: the planner and matplotlib take seconds

        planned = await self._client.plan(task, arguments)
        held = await self._client.robot()
        robot = self._robot if self._robot and self._robot.name == held["name"] else None
        png = await asyncio.to_thread(picture, planned.events, robot)
        image = base64.b64encode(png).decode()
        return [
            TextContent(text=_plan_words(planned)),
            ImageContent(data=image, mime_type="image/png"),
        ]

    async def run_task(
        self,
        task: int | str,
        arguments: Mapping[str, Any] | None = None,
        wait_s: float = WAIT,
    ) -> str:
        return await self._run(
            lambda client, goal_id: client.send(task, arguments, goal_id, deadman=True), wait_s
        )

    async def move(
        self,
        to: Sequence[str | float],
        relative: bool = False,
        speed: float = 1.0,
        wait_s: float = WAIT,
    ) -> str:
        move = Move.of(to, {}, relative, speed)
        return await self._run(
            lambda client, goal_id: client.send_move(move, goal_id, deadman=True), wait_s
        )

    async def goal_state(self, goal_id: str = "", wait_s: float = 0.0) -> str:
        goal = await self._goal(goal_id or str(self._person.state.get("goal", "")))
        if wait_s and not goal.outcome:
            with self._waits.one():
                goal = await follow(self._client, goal.identity, self._person, wait_s)
        return await self._goal_words(goal)

    async def pause(self, goal_id: str = "") -> str:
        goal = await self._client.pause((await self._goal(goal_id)).identity)
        return f"paused; {await self._goal_words(goal)}"

    async def resume(self, goal_id: str = "") -> str:
        goal = await self._client.resume((await self._goal(goal_id)).identity)
        return f"resumed; {await self._goal_words(goal)}"

    async def stop(self) -> str:
        try:
            canceled = ", ".join((await self._client.stop()).goals)
        except ServerUnreachable as error:
            cause, hint = cause_of(error), "tell the person to switch the power of the servos off"
            raise Refused(replace(cause, message=f"NOT STOPPED: {error}", hint=hint)) from error
        return f"stopped; canceled {canceled}" if canceled else "stopped; no goal was under way"

    async def arm_state(self) -> str:
        status, where = await asyncio.gather(self._client.status(), self._client.where())
        lines = [f"arm {status.arm}" + ("" if status.commanded else ": it cannot run tasks now")]
        if status.arm is State.INACTIVE:
            lines += [_BY_HAND]
        if status.fault:
            lines += [f"fault: {status.fault}", f"-> {status.fault.hint}"]
        if where.commanded:
            lines += [f"commanded {where.words(where.commanded)}"]
        if where.measured:
            lines += [f"measured {where.words(where.measured)}"]
        if where.tool:
            lines += [f"tool at {where.tool_words}"]
        if status.goal:
            doing = "PAUSED" if status.paused else " ".join((status.phase, status.node)).strip()
            lines += [doing, await self._goal_words(status.goal)]
        return "\n".join(lines)

    async def list_recordings(
        self, limit: int = 10, task: int | None = None, state: str = ""
    ) -> str:
        rows = await self._client.recordings(task=task, state=state, limit=limit)
        keys = ("name", "title", "state", "code", "message", "duration_s")
        return _lines([{key: row[key] for key in keys} for row in rows])

    async def explain_run(self, recording: str) -> str:
        window = await self._client.recorded_events(recording, _AT_THE_END)
        rows = await self._client.recordings(search=recording, limit=1)
        empty = {"title": recording, "state": "", "code": "", "message": "", "duration_s": None}
        return "\n".join(run_lines(rows[0] if rows else empty, window))

    async def _run(self, send: Send, wait: float) -> str:
        with self._waits.one():
            goal = await self._end_of(send, wait)
        words = await self._goal_words(goal)
        if goal.outcome and not goal.outcome.success:
            raise NotDone(words)
        return words

    async def _end_of(self, send: Send, wait: float) -> GoalStatus:
        """Send a goal, unless this call repeats an earlier one, and follow it."""
        known = self._person.state.get("goal")
        goal_id = str(known) if known else await self._held.send(self._connect, send)
        try:
            return await follow(self._client, goal_id, self._person, wait)
        except asyncio.CancelledError:
            self._held.release(goal_id)
            raise
        except ServerUnreachable as error:
            raise ServerLost from error

    async def _goal(self, goal_id: str) -> GoalStatus:
        """Return a goal by id, or the goal under way."""
        if goal_id:
            return await self._client.goal(goal_id)
        if found := (await self._client.status()).goal:
            return found
        raise NotExecuting

    async def _goal_words(self, goal: GoalStatus) -> str:
        if goal.outcome:
            return goal_words(goal)
        status = await self._client.status()
        paused = bool(status.paused and status.goal and status.goal.identity == goal.identity)
        return goal_words(goal, await self._client.questions(), paused)


_AT_THE_END = 1e9  # [s]


def _described(task: Task) -> dict[str, Any]:
    return {
        "task": task.number,
        "name": task.name,
        "description": task.description,
        "wrong": task.wrong,
        "arguments": arguments_schema(task),
    }


def _lines(rows: Sequence[Mapping[str, Any]]) -> str:
    return "\n".join(json.dumps(row, ensure_ascii=False) for row in rows) or "none"


def _plan_words(planned: PlannedTask) -> str:
    """Return the predicted end of a planned task in words."""
    end = planned.events[-1]
    assert isinstance(end, GoalStatus)
    assert end.outcome
    outcome = end.outcome
    kinds = [kind_of(event) for event in planned.events]
    frames = plural(kinds.count("sent"), "frame")
    how = f"{plural(kinds.count('plan'), 'plan')}, {frames}; nothing moved"
    lines = [f"valid; {how}"] if outcome.success else [f"{outcome.cause}; {how}", outcome.hint]
    return "\n".join(filter(None, [*lines, *planned.unknown]))
