"""The tools of `armtree mcp`, one row each. The method of `Calls` with the row's name answers."""

from collections.abc import Mapping
from dataclasses import field
from functools import partial

from executive.api import schemas as s
from executive.api.schemas import Schema
from hardware.loading.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Tool:
    """One tool.

    Attributes:
        name: Name of the tool, and of the method that answers.
        description: Description for language models.
        properties: Schema of every argument, by name.
        required: Arguments that must be given.
        reads: True if it only reads.
        moves: True if the arm may move, so that clients ask a person before they call it.
        repeatable: True if a second call with the same arguments has no further effect.
        limited: True if the rate limit applies.
    """

    name: str
    description: str
    properties: Mapping[str, Schema] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    reads: bool = False
    moves: bool = False
    repeatable: bool = True
    limited: bool = True

    @property
    def schema(self) -> dict[str, object]:
        """JSON Schema of the arguments. Unknown arguments are refused."""
        return {**s.body(*self.required, **self.properties)}


_read = partial(Tool, reads=True)
_move = partial(Tool, moves=True, repeatable=False)

WAIT = 50.0  # default of `wait_s`, because clients often limit a call to 60 s

_TASK = {"task": s.TASK_OR_NAME}
_CALL = {**_TASK, "arguments": {**s.ARGUMENTS, "description": "Values; see describe_task."}}
_WAIT = {
    "wait_s": {
        "type": "number",
        "minimum": 0,
        "maximum": 600,
        "description": f"Longest time to wait for the end [s]; default {WAIT:g}. Afterwards the "
        "goal continues, and goal_state waits for it.",
    }
}
_ONE_GOAL = {"goal_id": {**s.GOAL_ID, "description": "Id of a goal; default: the goal under way."}}

TOOLS = (
    _read("list_tasks", "List the tasks of the arm: number, name, what each does."),
    _read(
        "describe_task",
        "Describe a task, with the JSON Schema of its arguments.",
        _TASK,
        ("task",),
    ),
    _read(
        "check_task",
        "Check a task with its arguments, and plan all motions that are known before a run. "
        "Nothing moves.",
        _CALL,
        ("task",),
    ),
    _read(
        "plan_task",
        "Like check_task, with a picture: joints over time, the tree, and the arm from two sides.",
        _CALL,
        ("task",),
    ),
    _move(
        "run_task",
        "Run a task: THE ARM MOVES. Reports progress. Returns the outcome, or the goal if it has "
        "not ended in time. Only the person answers questions of the task, never you. Canceling "
        "the call stops the arm.",
        {**_CALL, **_WAIT},
        ("task",),
    ),
    _read(
        "goal_state",
        "Return the state of a goal, and the outcome if it has ended.",
        {**_ONE_GOAL, **_WAIT},
    ),
    Tool("pause", "Stop the arm and keep the goal.", _ONE_GOAL),
    _move("resume", "Resume a paused goal: THE ARM MOVES.", _ONE_GOAL),
    Tool(
        "stop",
        "Stop the arm and cancel all goals. Always allowed, also when other calls are refused. "
        "This is not an emergency stop: to be safe, switch the power of the servos off.",
        limited=False,
    ),
    _read("arm_state", "Return the state of the arm: whether it may move, where it is, faults."),
    _read(
        "list_recordings",
        "List the last runs, the newest first, with the outcome of each.",
        {
            "limit": {
                "type": "integer",
                "minimum": 1,
                "maximum": 50,
                "description": "Largest number of runs; default 10.",
            },
            "task": {"type": "integer", "minimum": -1, "maximum": 2**31 - 1},
            "state": {"type": "string", "enum": ["SUCCEEDED", "CANCELED", "ABORTED", "UNFINISHED"]},
        },
    ),
    _read(
        "explain_run",
        "Explain how a run ended: cause, limits, what to do, failed nodes, warnings.",
        {"recording": {**s.RECORDING_NAME, "description": "Name from list_recordings."}},
        ("recording",),
    ),
)

MOVE = _move(
    "move",
    "Move joints, or the tool to a point: THE ARM MOVES. Motions are planned without collisions.",
    {
        "to": s.TARGET,
        "relative": {**s.BOOLEAN, "description": "True if the target is a change; default false."},
        "speed": s.SPEED,
        **_WAIT,
    },
    ("to",),
)
