"""What can be asked over HTTP, as one table; the routes, the checks and the document follow it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Schema = Mapping[str, Any]

LISTED = 150  # goals in a list, the newest: all that run or wait, and what has just ended

IDENTITY = {
    "title": "32 lower-case hexadecimal digits",
    "type": "string",
    "pattern": "^[0-9a-f]{32}$",
    "maxLength": 32,
    "minLength": 32,
}
_STAMP = {"type": "integer", "minimum": 0, "maximum": 2**63 - 1}


def _object(required: tuple[str, ...] = (), **properties: Schema) -> Schema:
    shape = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**shape, "required": list(required)} if required else shape


NOTHING = _object()
TASK = _object(
    ("task",),
    task={"type": "integer", "minimum": 0, "maximum": 2**31 - 1, "description": "Its number."},
    arguments={
        "type": "object",
        "maxProperties": 64,
        "additionalProperties": {"type": ["string", "number", "boolean", "array", "object"]},
        "description": "Values of the task's parameters; a text is read as it would be in a file.",
    },
    goal_id={**IDENTITY, "description": "Made here where it is missing."},
    deadman={
        "type": "boolean",
        "description": "Cancel the goal when its hold ends; hold it before you send it.",
    },
)
WHICH = _object(
    goal_id={**IDENTITY, "description": "This goal, whenever it was accepted."},
    stamp_ns={**_STAMP, "description": "All that were accepted at or before this [ns]."},
)
UP_TO = _object(stamp_ns=WHICH["properties"]["stamp_ns"])
STANDS = _object(
    pose={
        "type": "string",
        "enum": ["boot", "last"],
        "description": "Where the arm stands, to activate one whose board is not reset: in its "
        "boot pose, or where it was commanded to last.",
    }
)
ANSWER = _object(
    ("answer",),
    answer={
        "type": "string",
        "maxLength": 1024,
        "minLength": 1,
        "description": "One of its choices, which may be abbreviated where it stays clear.",
    },
)
BREAKPOINT = _object(
    ("node",),
    node={
        "type": "string",
        "maxLength": 1024,
        "minLength": 1,
        "description": "Its path, such as `pick/Execute`.",
    },
    on={"type": "boolean", "description": "False to have it no longer."},
)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A part of the address.

    Attributes:
        name: As it is written there.
        schema: What it may be.
        where: `path` or `query`.
    """

    name: str
    schema: Schema
    where: str = "query"


_GOAL = Parameter("goal_id", IDENTITY, "path")
QUESTION = {"type": "string", "pattern": "^[0-9a-f]{8}$", "maxLength": 8, "minLength": 8}
_QUESTION = Parameter("question_id", QUESTION, "path")
_TIMEOUT = Parameter(
    "timeout",
    {"type": "number", "minimum": 0, "maximum": 3600, "description": "How long to wait [s]."},
)
_EVENTS = Parameter(
    "events",
    {
        "type": "string",
        "pattern": "^[a-z]+(,[a-z]+)*$",
        "maxLength": 200,
        "description": "Only these kinds, such as `goal,status`; all where it is missing.",
    },
)
_PAGE = (
    Parameter(
        "limit",
        {
            "type": "integer",
            "minimum": 1,
            "maximum": LISTED,
            "description": f"So many at most, the newest; {LISTED} where it is missing.",
        },
    ),
    Parameter(
        "before",
        {**_STAMP, "description": "Only those that were accepted before this [ns since 1970]."},
    ),
)
_TRANSITION = Parameter(
    "transition",
    {"type": "string", "enum": ["configure", "activate", "deactivate", "cleanup", "shutdown"]},
    "path",
)


@dataclass(frozen=True, slots=True)
class Operation:
    """One thing that can be asked.

    Attributes:
        method: GET reads, POST changes.
        path: Its address.
        name: Of the method of `Api` that answers, and its id in the document.
        summary: What it does.
        answer: Name of the answer's schema in the document; empty for another media type.
        body: What may be sent; None for an operation that takes nothing.
        parameters: In the address.
        stops: Whether it stops the arm: it needs no token, and nothing limits it.
        streams: Whether its body is read, or its answer written, as long as the client stays.
        status: Of a good answer.
        media: Type of the answer.
    """

    method: str
    path: str
    name: str
    summary: str
    answer: str = ""
    body: Schema | None = None
    parameters: tuple[Parameter, ...] = field(default=())
    stops: bool = False
    streams: bool = False
    status: int = 200
    media: str = "application/json"

    @property
    def blind(self) -> bool:
        """Whether nothing that is sent along is looked at."""
        return self.stops and self.body is None


OPERATIONS = (
    Operation("GET", "/api/health", "health", "Whether the server answers.", "Health"),
    Operation("GET", "/api/status", "status", "What the arm and the goals are at.", "Status"),
    Operation("GET", "/api/tasks", "tasks", "The tasks there are.", "Tasks"),
    Operation(
        "GET",
        "/api/goals",
        "goals",
        "The goals that are known, the newest of them, page by page.",
        "Goals",
        parameters=_PAGE,
    ),
    Operation("POST", "/api/goals", "send", "Run a task.", "Accepted", TASK, status=201),
    Operation(
        "GET", "/api/goals/{goal_id}", "goal", "What a goal is at.", "Goal", parameters=(_GOAL,)
    ),
    Operation(
        "GET",
        "/api/goals/{goal_id}/result",
        "result",
        "How a goal ended; waits for it.",
        "Result",
        parameters=(_GOAL, _TIMEOUT),
        streams=True,
    ),
    Operation(
        "POST",
        "/api/goals/{goal_id}/hold",
        "hold",
        "Hold a goal: it is canceled when this body ends, or nothing of it comes for a second.",
        "Released",
        parameters=(_GOAL,),
        streams=True,
    ),
    Operation(
        "POST",
        "/api/goals/{goal_id}/cancel",
        "cancel_goal",
        "Cancel a goal, and with a stamp all that were accepted until then.",
        "Canceled",
        UP_TO,
        (_GOAL,),
        stops=True,
    ),
    Operation(
        "POST",
        "/api/cancel",
        "cancel",
        "Cancel all goals, or those that are named; the arm stops.",
        "Canceled",
        WHICH,
        stops=True,
    ),
    Operation(
        "POST",
        "/api/stop",
        "stop",
        "Stop the arm, cancel all. Whatever else is sent along is not looked at.",
        "Canceled",
        stops=True,
    ),
    Operation(
        "POST",
        "/api/goals/{goal_id}/pause",
        "pause",
        "Stop the arm and keep the goal.",
        "Goal",
        NOTHING,
        (_GOAL,),
    ),
    Operation(
        "POST",
        "/api/goals/{goal_id}/resume",
        "resume",
        "Go on with a goal.",
        "Goal",
        NOTHING,
        (_GOAL,),
    ),
    Operation(
        "POST",
        "/api/goals/{goal_id}/step",
        "step",
        "Let one node of a goal begin, then pause again.",
        "Goal",
        NOTHING,
        (_GOAL,),
    ),
    Operation(
        "POST",
        "/api/breakpoints",
        "break_at",
        "Have every goal pause before a node begins, or no longer.",
        "Breakpoints",
        BREAKPOINT,
    ),
    Operation("GET", "/api/questions", "questions", "What tasks ask now.", "Questions"),
    Operation(
        "POST",
        "/api/questions/{question_id}/answer",
        "answer",
        "Answer a question; the first answer counts.",
        "Answer",
        ANSWER,
        (_QUESTION,),
    ),
    Operation(
        "POST",
        "/api/arm/{transition}",
        "arm",
        "Take the arm through its lifecycle; activate opens the port, which moves the arm.",
        "Arm",
        STANDS,
        (_TRANSITION,),
    ),
    Operation(
        "GET",
        "/api/events",
        "events",
        "What happens, as server-sent events, each a JSON object as `armtree run --json` prints.",
        parameters=(_EVENTS,),
        streams=True,
        media="text/event-stream",
    ),
    Operation(
        "GET", "/metrics", "metrics", "Figures for Prometheus.", media="text/plain; version=0.0.4"
    ),
    Operation("GET", "/openapi.json", "openapi", "This document.", "OpenApi"),
)
