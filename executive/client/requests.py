"""What can be asked of a server, without the asking: both clients send these."""

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar
from urllib.parse import urlsplit

from executive.errors import ResultTimeout
from executive.goals.events import Status
from executive.goals.outcome import CancelResult, GoalStatus, Outcome, cause_of
from executive.server import token_file

from .errors import Refused

T = TypeVar("T")

POLL_PERIOD = 15.0  # [s] that an answer may wait for a goal's end; then it is asked for again
NOT_YET = ResultTimeout.code

_OUR_NAMES = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True, slots=True)
class Task:
    """A task that a server has.

    Attributes:
        number: By which it is called.
        name: Of it.
        description: In a sentence.
        source: `shipped`, or its file.
        parameters: Their types by name.
        wrong: What is wrong with its file; empty where nothing is.
    """

    number: int
    name: str
    description: str
    source: str
    parameters: Mapping[str, str]
    wrong: str


@dataclass(frozen=True, slots=True)
class OpenQuestion:
    """What a task requests.

    Attributes:
        question_id: 8 hexadecimal digits.
        text: What is asked.
        choices: The answers there are; empty where any words do.
    """

    question_id: str
    text: str
    choices: tuple[str, ...]

    def __str__(self) -> str:
        choices = f" [{'/'.join(self.choices)}]" if self.choices else ""
        return f"{self.question_id}  {self.text}{choices}"


@dataclass(frozen=True, slots=True)
class Request(Generic[T]):
    """A request.

    Attributes:
        method: Of HTTP.
        path: Of the address.
        read: Makes the answer of the JSON that comes.
        body: What to send; None for nothing.
        query: Parameters.
        patience: How long the answer may take beyond the usual [s].
    """

    method: str
    path: str
    read: Callable[[Any], T]
    body: Mapping[str, Any] | None = None
    query: Mapping[str, Any] = field(default_factory=dict)
    patience: float = 0.0


@dataclass(frozen=True, slots=True)
class Address:
    """Where a server is, and what it wants to see.

    Attributes:
        url: Of it.
        headers: Of every request.
    """

    url: str
    headers: Mapping[str, str]


def address(url: str | None, token: str | None) -> Address:
    """The server that is meant.

    Args:
        url: Of it; else ARMTREE_SERVER, else this machine's.
        token: Of it; else ARMTREE_TOKEN, else what it wrote for this user.
    """
    port = os.environ.get("ARMTREE_TCP_PORT", token_file.PORT)
    url = (url or os.environ.get("ARMTREE_SERVER") or f"http://127.0.0.1:{port}").rstrip("/")
    token = token or os.environ.get("ARMTREE_TOKEN") or _own_token(url)
    return Address(url, {"authorization": f"Bearer {token}"} if token else {})


def _own_token(url: str) -> str:
    """The token of a server of this user on this machine; empty where there is none."""
    parts = urlsplit(url)
    port = parts.port or (token_file.HTTP_PORT if parts.scheme == "http" else 0)
    known = token_file.read(port) if parts.hostname in _OUR_NAMES else None
    return known.token if known else ""


def send(task: int, arguments: Mapping[str, Any], goal_id: str, deadman: bool) -> Request[str]:
    """Send a goal; the answer is its identity."""
    body: dict[str, Any] = {"task": task, "arguments": dict(arguments), "deadman": deadman}
    if goal_id:
        body["goal_id"] = goal_id
    return Request("POST", "/api/goals", lambda told: str(told["goal_id"]), body)


def waits(timeout: float | None) -> Iterator[float]:
    """How long to wait for a result [s], at a time: so a server that is frozen is noticed."""
    left = math.inf if timeout is None else timeout
    while left > POLL_PERIOD:
        yield POLL_PERIOD
        left -= POLL_PERIOD
    yield left


def result(goal_id: str, timeout: float) -> Request[Outcome]:
    """Wait for the outcome of a goal [s]."""
    query = {"timeout": timeout}
    return Request(
        "GET", f"/api/goals/{goal_id}/result", Outcome.from_json, query=query, patience=timeout
    )


def not_ended(goal_id: str, timeout: float | None) -> Refused:
    """What a server says of a goal that has not ended in so long [s]."""
    return Refused(cause_of(ResultTimeout(goal_id, timeout or 0.0)).to_json())


def goal(goal_id: str) -> Request[GoalStatus]:
    """What a goal is at."""
    return Request("GET", f"/api/goals/{goal_id}", GoalStatus.from_json)


def goals(after: tuple[GoalStatus, ...]) -> Request[tuple[GoalStatus, ...]]:
    """The page of goals that comes before those that are there already."""
    query = {"before": after[0].stamp_ns} if after else {}
    return Request(
        "GET",
        "/api/goals",
        lambda told: tuple(map(GoalStatus.from_json, told["goals"])),
        query=query,
    )


def cancel(goal_id: str, stamp_ns: int) -> Request[CancelResult]:
    """Cancel goals."""
    body = {
        **({"goal_id": goal_id} if goal_id else {}),
        **({"stamp_ns": stamp_ns} if stamp_ns else {}),
    }
    return Request("POST", "/api/cancel", CancelResult.from_json, body)


def stop() -> Request[CancelResult]:
    """Stop the arm."""
    return Request("POST", "/api/stop", CancelResult.from_json, {})


def change(goal_id: str, verb: str) -> Request[GoalStatus]:
    """Pause, resume or step a goal."""
    return Request("POST", f"/api/goals/{goal_id}/{verb}", GoalStatus.from_json, {})


def break_at(node: str, on: bool) -> Request[tuple[str, ...]]:
    """Set or lift a breakpoint."""
    body = {"node": node, "on": on}
    return Request("POST", "/api/breakpoints", lambda told: tuple(told["breakpoints"]), body)


def questions() -> Request[tuple[OpenQuestion, ...]]:
    """What tasks ask now."""
    return Request("GET", "/api/questions", lambda told: tuple(map(_question, told["questions"])))


def answer(question_id: str, words: str) -> Request[str]:
    """Answer a question."""
    path = f"/api/questions/{question_id}/answer"
    return Request("POST", path, lambda told: str(told["answer"]), {"answer": words})


def arm(transition: str, pose: str | None) -> Request[str]:
    """Take the arm through a transition; booting takes its time."""
    body = {"pose": pose} if pose else {}
    return Request(
        "POST", f"/api/arm/{transition}", lambda told: str(told["arm"]), body, patience=30.0
    )


def status() -> Request[Status]:
    """What the server is at."""
    return Request("GET", "/api/status", Status.from_json)


def tasks() -> Request[tuple[Task, ...]]:
    """The tasks there are."""
    return Request("GET", "/api/tasks", lambda told: tuple(map(_task, told["tasks"])))


def _question(told: Any) -> OpenQuestion:
    return OpenQuestion(told["question_id"], told["text"], tuple(told["choices"]))


def _task(told: Any) -> Task:
    return Task(
        told["task"],
        told["name"],
        told["description"],
        told["source"],
        told["parameters"],
        told["wrong"],
    )
