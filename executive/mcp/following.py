"""Follows a goal: progress, questions, outcome."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import logs
from executive.api.events import Event, QuestionStatus
from executive.api.outcome import GoalStatus
from executive.client.asynchronous import AsyncClient
from executive.errors import ClientError, TooMuch

from .asking import Person

MOST = 4  # largest number of calls that wait; each has one of the server's streams of events


class Waits:
    """The calls of a process that wait for goals. Their number is limited.

    People and other programs need streams of the server too.
    """

    def __init__(self) -> None:
        self._number = 0

    @contextmanager
    def one(self) -> Iterator[None]:
        """Count a call that waits.

        Raises:
            TooMuch: Too many calls wait.
        """
        if self._number >= MOST:
            raise TooMuch(f"{MOST} calls wait already", "let one end, or read goal_state at once")
        self._number += 1
        try:
            yield
        finally:
            self._number -= 1


async def follow(client: AsyncClient, goal_id: str, person: Person, wait: float) -> GoalStatus:
    """Follow a goal: report its progress, put its questions to the person, and pass the answers on.

    Args:
        client: Client of the server.
        goal_id: Id of the goal.
        person: Person who answers questions.
        wait: Longest time to wait for the end of the goal [s].

    Returns:
        State of the goal: when it ends, after `wait`, or when a question comes that the client
        cannot show to a person.

    Raises:
        MustRepeat: The client must repeat the call with the answer to a question.
        ClientError: The server does not answer any more.
    """
    run = _Run(client, goal_id, person)
    if question := person.state.get("question"):
        await run.answer(question, person.answer)
    try:
        async with (
            asyncio.timeout(wait),
            client.events("goal", "feedback", "question", "status") as events,
        ):
            if (found := await client.goal(goal_id)).outcome:
                return found
            async for event in events:
                if isinstance(event, GoalStatus):
                    if event.identity == goal_id and event.outcome:
                        return event
                elif not await run.take(event):
                    break
    except TimeoutError:
        pass
    finally:
        run.close()
    return await client.goal(goal_id)


class _Run:
    """The run of a goal, followed by its events.

    Args:
        client: Client of the server.
        goal_id: Id of the goal.
        person: Person who answers questions.
    """

    def __init__(self, client: AsyncClient, goal_id: str, person: Person) -> None:
        self._client, self._goal_id, self._person = client, goal_id, person
        self._ours, self._percentage = False, -1
        self._asked = set[str](person.state.get("asked", ()))
        self._asking: dict[str, asyncio.Task[None]] = {}

    async def take(self, event: Event) -> bool:
        """Process an event. Return False for a question that the client cannot show."""
        match event:
            case logs.Goal():
                self._ours = event.goal_id == self._goal_id
            case logs.Feedback() if self._ours:
                await self._report(event)
            case QuestionStatus() if self._ours:
                return await self._take_question(event)
        return True

    async def _report(self, feedback: logs.Feedback) -> None:
        """Report progress. It never decreases."""
        if (percentage := feedback.percentage or 0) > self._percentage:
            self._percentage = percentage
            message = " ".join(filter(None, (feedback.phase, feedback.node)))
            await self._person.context.session.report_progress(percentage, 100, message)

    async def _take_question(self, question: QuestionStatus) -> bool:
        identity = question.question_id
        if not question.open:
            if task := self._asking.pop(identity, None):
                task.cancel()
        elif not self._person.can_answer:
            return False
        elif identity not in self._asked:
            self._asked.add(identity)
            if self._person.repeats:
                await self._put(question)
            self._asking[identity] = asyncio.create_task(self._put(question))
        return True

    async def _put(self, question: QuestionStatus) -> None:
        """Put a question to the person, and answer it with their words."""
        state = {"goal": self._goal_id, "question": question.question_id, "asked": [*self._asked]}
        text = f"The task asks: {question.text}"
        words = await self._person.ask(text, question.choices, state)
        await self.answer(question.question_id, words)

    async def answer(self, question_id: str, words: str | None) -> None:
        """Answer a question, unless the person has given no answer."""
        if words is not None:
            with suppress(ClientError):  # another person has answered first
                await self._client.answer(question_id, words)

    def close(self) -> None:
        """Withdraw open questions."""
        for task in self._asking.values():
            task.cancel()
