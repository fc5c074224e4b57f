"""The OpenAPI document, made from the table of operations."""

from importlib.metadata import version
from typing import Any

from executive.goals.goal import GoalState
from hardware import State

from .operations import IDENTITY, OPERATIONS, QUESTION, Operation, Parameter

_TEXT = {"type": "string"}
_NUMBER = {"type": "number"}
_COUNT = {"type": "integer", "minimum": 0}
_GIVEN_TASK = {
    "type": "integer",
    "minimum": -(2**31),
    "maximum": 2**31 - 1,
    "description": "As it was asked for; clients of rosbridge may give any int32.",
}
_YES = {"type": "boolean"}
_STATE = {"type": "string", "enum": [state.name for state in GoalState]}
_ENDS = {"type": "string", "enum": ["SUCCEEDED", "CANCELED", "ABORTED"]}
_ARM = {"type": "string", "enum": [state.value for state in State]}


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _list(items: Any) -> dict[str, Any]:
    return {"type": "array", "items": items}


def _or_null(schema: Any) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


def _ref(name: str) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{name}"}


_CAUSE = _object(
    code={**_TEXT, "description": "Stable name; executive/README.md lists all."},
    message=_TEXT,
    node={**_TEXT, "description": "Path in the tree; empty where none is to blame."},
    joint=_TEXT,
    value={**_or_null(_NUMBER), "description": "What was wrong [rad], [m] or [s]."},
    limit={**_or_null(_NUMBER), "description": "What it is held against, in the same unit."},
    hint=_TEXT,
)
SCHEMAS = {
    "Error": _CAUSE,
    "Health": _object(ok=_YES, version=_TEXT),
    "Result": _object(
        goal_id=IDENTITY,
        task=_GIVEN_TASK,
        state=_ENDS,
        success=_YES,
        frames=_COUNT,
        duration_s=_NUMBER,
        recording=_TEXT,
        code=_TEXT,
        message=_TEXT,
        cause=_or_null(_ref("Error")),
    ),
    "Goal": _object(
        goal_id=IDENTITY,
        task=_GIVEN_TASK,
        state=_STATE,
        stamp_ns=_COUNT,
        result=_or_null(_ref("Result")),
    ),
    "Goals": _object(goals=_list(_ref("Goal"))),
    "Accepted": _object(goal_id=IDENTITY, stamp_ns=_COUNT),
    "Released": _object(goal_id=IDENTITY, canceled=_YES),
    "Canceled": _object(
        return_code={
            "type": "integer",
            "enum": [0, 1, 2, 3],
            "description": "As in action_msgs/srv/CancelGoal: none, rejected, unknown, ended.",
        },
        goals=_list(IDENTITY),
    ),
    "Status": _object(
        arm=_ARM,
        fault={
            **_or_null(_ref("Error")),
            "description": "What took the arm out of active, until it is activated again.",
        },
        port=_TEXT,
        commanded=_or_null({"type": "object", "additionalProperties": _NUMBER}),
        goal=_or_null(_ref("Goal")),
        percentage=_or_null({"type": "integer", "minimum": 0, "maximum": 100}),
        phase=_TEXT,
        node=_TEXT,
        attempt=_COUNT,
        waiting=_list(IDENTITY),
        policy={"type": "string", "enum": ["reject", "queue", "preempt"]},
        paused=_YES,
        breakpoints=_list(_TEXT),
        uptime_s=_NUMBER,
    ),
    "Breakpoints": _object(breakpoints=_list(_TEXT)),
    "Task": _object(
        task=_COUNT,
        name=_TEXT,
        description=_TEXT,
        source=_TEXT,
        parameters={"type": "object", "additionalProperties": _TEXT},
        wrong=_TEXT,
    ),
    "Tasks": _object(tasks=_list(_ref("Task"))),
    "Questions": _object(
        questions=_list(_object(question_id=QUESTION, text=_TEXT, choices=_list(_TEXT)))
    ),
    "Answer": _object(question_id=QUESTION, answer=_TEXT),
    "Arm": _object(arm=_ARM),
    "OpenApi": {"type": "object"},
}


def document() -> dict[str, Any]:
    """The document."""
    paths: dict[str, dict[str, Any]] = {}
    for operation in OPERATIONS:
        paths.setdefault(operation.path, {})[operation.method.lower()] = _described(operation)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "armtree",
            "version": version("armtree"),
            "description": "Goals for a robot arm. Positions are commanded, in rad; the stop is "
            "no emergency stop.",
        },
        "paths": paths,
        "components": {
            "schemas": SCHEMAS,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _described(operation: Operation) -> dict[str, Any]:
    good: dict[str, Any] = {"description": operation.summary}
    schema = _ref(operation.answer) if operation.answer else _TEXT
    good["content"] = {operation.media: {"schema": schema}}
    error = {
        "description": "Refused; `code` says why.",
        "content": {"application/json": {"schema": _ref("Error")}},
    }
    made: dict[str, Any] = {
        "operationId": operation.name,
        "summary": operation.summary,
        "responses": {str(operation.status): good, "4XX": error},
    }
    if operation.parameters:
        made["parameters"] = [_parameter(each) for each in operation.parameters]
    if operation.body is not None:
        made["requestBody"] = {
            "required": bool(operation.body.get("required")),
            "content": {"application/json": {"schema": operation.body}},
        }
    if operation.method == "POST" and not operation.stops:
        made["security"] = [{"token": []}]
    return made


def _parameter(parameter: Parameter) -> dict[str, Any]:
    return {
        "name": parameter.name,
        "in": parameter.where,
        "required": parameter.where == "path",
        "schema": parameter.schema,
    }
