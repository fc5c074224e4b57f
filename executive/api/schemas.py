"""JSON Schemas of what the server accepts and answers."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from hardware import State
from hardware.joints import DISPLAY_UNITS

from .events import UNITS, Policy
from .outcome import CancelCode, Cause, GoalState, Outcome

Schema = Mapping[str, Any]

MAX_LISTED = 150  # goals in one answer


@dataclass(frozen=True, slots=True)
class Component:
    """A schema that the OpenAPI document lists under its name.

    Attributes:
        name: Name in the document.
        schema: The schema. It may contain other components.
    """

    name: str
    schema: Schema


def inlined(schema: Any) -> Any:
    """Return a schema with its components replaced by their schemas."""
    match schema:
        case Component():
            return inlined(schema.schema)
        case Mapping():
            return {key: inlined(each) for key, each in schema.items()}
        case list():
            return [inlined(each) for each in schema]
    return schema


def body(*required: str, **properties: Any) -> Schema:
    """Return the schema of a request's body: an object without any other keys.

    Args:
        required: Keys that must be present.
        properties: Schema of every key.
    """
    schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**schema, "required": list(required)} if required else schema


def answer(name: str, /, **properties: Any) -> Component:
    """Return the schema of an answer: an object that has all of these keys."""
    return Component(name, _object(properties))


def array(items: Any) -> dict[str, Any]:
    """Return the schema of a list."""
    return {"type": "array", "items": items}


def _object(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _or_null(schema: Any) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


def _plain_fields(kind: Any) -> dict[str, Any]:
    """Return the schemas of a dataclass's texts and numbers, by their names in JSON."""
    return {
        UNITS.get(field.name, field.name): _TYPES[field.type]
        for field in fields(kind)
        if field.type in _TYPES
    }


TEXT = {"type": "string"}
NUMBER = {"type": "number"}
COUNT = {"type": "integer", "minimum": 0}
BOOLEAN = {"type": "boolean"}
_TYPES: dict[Any, Any] = {
    str: TEXT,
    int: COUNT,
    float: NUMBER,
    float | None: _or_null(NUMBER),
}

GOAL_ID = {
    "title": "32 lower-case hexadecimal digits",
    "type": "string",
    "pattern": "^[0-9a-f]{32}$",
    "maxLength": 32,
    "minLength": 32,
}
QUESTION_ID = {"type": "string", "pattern": "^[0-9a-f]{8}$", "maxLength": 8, "minLength": 8}
STAMP = {"type": "integer", "minimum": 0, "maximum": 2**63 - 1}
ARM_STATE = {"type": "string", "enum": [state.value for state in State]}

# Requests

EMPTY = body()
UNTIL = {**STAMP, "description": "Cancel every goal accepted at or before this time [ns]."}
TASK_NUMBER = {
    "type": "integer",
    "minimum": 0,
    "maximum": 2**31 - 1,
    "description": "Number of the task.",
}
TASK_OR_NAME = {
    "title": "the number or the name of a task",
    "anyOf": [
        TASK_NUMBER,
        {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_-]*$", "maxLength": 250},
    ],
    "description": "Number or name of the task.",
}
ARGUMENTS = {
    "type": "object",
    "maxProperties": 64,
    "additionalProperties": {"type": ["string", "number", "boolean", "array", "object"]},
    "description": "Values of the task's parameters. A text is read as in a task file.",
}
TARGET = {
    "type": "array",
    "minItems": 1,
    "maxItems": 64,
    "items": {"anyOf": [{"type": "string", "maxLength": 64, "minLength": 1}, NUMBER]},
    "description": "Words of `armtree move`: `joint_1=70deg`, `width=20mm` (gripper), poses, or "
    "x, y, z of the tool [m].",
}
SPEED = {
    "type": "number",
    "minimum": 0.01,
    "maximum": 1,
    "description": "Share of the robot's speed; default 1.",
}
MOMENT = {"type": "number", "minimum": 0, "maximum": 1e9}
START_POSE = {
    "type": "string",
    "enum": ["boot", "last"],
    "description": "Pose of the arm when it is activated and its board does not reset: "
    "that of the robot file, or the last commanded pose.",
}


def words(description: str) -> Schema:
    """Return the schema of a text of 1 to 1024 characters."""
    return {"type": "string", "maxLength": 1024, "minLength": 1, "description": description}


# Answers

ERROR = answer(
    "Error",
    **_plain_fields(Cause)
    | {
        "code": {**TEXT, "description": "Stable name; executive/README.md lists all."},
        "node": {**TEXT, "description": "Path in the tree; empty if the cause is outside it."},
        "value": {**_or_null(NUMBER), "description": "The wrong value [rad], [m] or [s]."},
        "limit": {**_or_null(NUMBER), "description": "The limit of the value, in the same unit."},
    },
)
_ANY_TASK = {
    "type": "integer",
    "minimum": -(2**31),
    "maximum": 2**31 - 1,
    "description": "Number in the request; clients of rosbridge may send any int32.",
}
RESULT = answer(
    "Result",
    goal_id=GOAL_ID,
    state={"type": "string", "enum": ["SUCCEEDED", "CANCELED", "ABORTED"]},
    success=BOOLEAN,
    cause=_or_null(ERROR),
    **_plain_fields(Outcome) | {"task": _ANY_TASK},
)
GOAL = answer(
    "Goal",
    goal_id=GOAL_ID,
    task=_ANY_TASK,
    state={"type": "string", "enum": [state.name for state in GoalState]},
    stamp_ns=COUNT,
    result=_or_null(RESULT),
)
CANCELED = answer(
    "Canceled",
    return_code={
        "type": "integer",
        "enum": [code.value for code in CancelCode],
        "description": "As in action_msgs/srv/CancelGoal: 0 none, 1 rejected, 2 unknown goal, "
        "3 goal has ended.",
    },
    goals=array(GOAL_ID),
)
_BY_JOINT = {"type": "object", "additionalProperties": NUMBER}
POSE = answer(
    "Pose",
    pose=TEXT,
    positions=_BY_JOINT,
    source={**TEXT, "description": "`FILE:LINE`, or that it ships."},
)
STATUS = answer(
    "Status",
    arm=ARM_STATE,
    fault={
        **_or_null(ERROR),
        "description": "The fault that deactivated the arm; null after the next activation.",
    },
    port=TEXT,
    commanded=_or_null(_BY_JOINT),
    measured=_or_null(_BY_JOINT),
    goal=_or_null(GOAL),
    percentage=_or_null({"type": "integer", "minimum": 0, "maximum": 100}),
    phase=TEXT,
    node=TEXT,
    attempt=COUNT,
    waiting=array(GOAL_ID),
    policy={"type": "string", "enum": [policy.value for policy in Policy]},
    paused=BOOLEAN,
    breakpoints=array(TEXT),
    uptime_s=NUMBER,
)
_VECTOR = {**array(NUMBER), "minItems": 3, "maxItems": 3}
DIGEST = {
    "title": "the digest of a mesh",
    "type": "string",
    "pattern": "^([0-9a-f]{32}|[0-9a-f]{12}_[^/]+)$",
    "maxLength": 250,
    "description": "Digest of a mesh of the robot, or `path` of a body's mesh in a plan.",
}
ROBOT = answer(
    "Robot",
    name=TEXT,
    opening={**TEXT, "description": "What the arm does when its port is opened."},
    links=array(TEXT),
    joints=array(
        _object(
            {
                "name": TEXT,
                "type": {
                    "type": "string",
                    "enum": ["revolute", "continuous", "prismatic", "fixed"],
                },
                "unit": {"type": "string", "enum": list(DISPLAY_UNITS)},
                "parent": TEXT,
                "child": TEXT,
                "xyz": _VECTOR,
                "rpy": _VECTOR,
                "axis": _VECTOR,
                "mimic": {
                    "type": ["array", "null"],
                    "description": "The joint that it follows, the factor, and the offset.",
                },
            }
        )
    ),
    shapes=array(
        _object(
            {
                "link": TEXT,
                "kind": {"type": "string", "enum": ["box", "sphere", "cylinder", "mesh"]},
                "sizes": {
                    **array(NUMBER),
                    "description": "x, y, z; radius; or radius and length [m]; scale of a mesh.",
                },
                "mesh": {**TEXT, "description": "Digest for `/api/meshes`; empty for no mesh."},
                "xyz": _VECTOR,
                "rpy": _VECTOR,
                "color": _or_null({**array(NUMBER), "minItems": 4, "maxItems": 4}),
            }
        )
    ),
    groups={
        "type": "object",
        "additionalProperties": array(TEXT),
        "description": "Actuated joints of each group.",
    },
    tool=_or_null(_object({"link": TEXT, "offset": _VECTOR})),
)
WHERE = answer(
    "Where",
    arm=ARM_STATE,
    units={
        "type": "object",
        "additionalProperties": {"type": "string", "enum": list(DISPLAY_UNITS)},
        "description": "Unit of the position of each joint.",
    },
    limits={
        "type": "object",
        "additionalProperties": _or_null({**array(NUMBER), "minItems": 2, "maxItems": 2}),
        "description": "Smallest and largest position of each joint; null if it has no limits.",
    },
    boot_wait_s=NUMBER,
    commanded={
        **_or_null(_BY_JOINT),
        "description": "Commanded position by joint; null if the arm is not active.",
    },
    measured={
        **_or_null(_BY_JOINT),
        "description": "Measured position by joint; null if the board measures none.",
    },
    measured_velocity={**_or_null(_BY_JOINT), "description": "Measured velocity by joint."},
    measured_effort={
        **_or_null(_BY_JOINT),
        "description": "Measured part of the largest torque of the servo, -1 to 1, by joint.",
    },
    temperature={**_or_null(_BY_JOINT), "description": "Temperature of the servo [C], by joint."},
    voltage={**_or_null(_BY_JOINT), "description": "Voltage of its supply [V], by joint."},
    tool={
        **_or_null({**array(NUMBER), "minItems": 3, "maxItems": 3}),
        "description": "x, y, z of the tool at the commanded position [m].",
    },
    width={
        **_or_null(NUMBER),
        "description": "Distance between the fingers at the commanded position [m].",
    },
)
TASK = answer(
    "Task",
    task=COUNT,
    name=TEXT,
    description=TEXT,
    source=TEXT,
    parameters={"type": "object", "additionalProperties": TEXT},
    inputs={
        "type": "object",
        "additionalProperties": _object(
            {
                "type": TEXT,
                "unit": {**TEXT, "description": "Unit of the limits; may be empty."},
                "needed": BOOLEAN,
                "default": {**TEXT, "description": "As in a task file; empty for none."},
                "least": _or_null(NUMBER),
                "most": _or_null(NUMBER),
                "choices": array(TEXT),
                "description": TEXT,
            }
        ),
    },
    wrong=TEXT,
)
NODE = _object(
    {
        "path": TEXT,
        "kind": TEXT,
        "file": TEXT,
        "line": COUNT,
        "called_at": {
            **TEXT,
            "description": "`FILE:LINE` that refers to it, if it is the root of a subtree.",
        },
        "ports": {"type": "object", "additionalProperties": TEXT},
    }
)
QUESTION = _object({"question_id": QUESTION_ID, "text": TEXT, "choices": array(TEXT)})
RECORDING_NAME = {
    "title": "the name of a recording",
    "type": "string",
    "pattern": r"^[^/\\\x00-\x1f.][^/\\\x00-\x1f]*\.mcap$",
    "maxLength": 255,
}
_CLOCK = {**NUMBER, "description": "From the beginning of the goal [s]."}
RECORDING = answer(
    "Recording",
    name=RECORDING_NAME,
    bytes=COUNT,
    stamp_ns={**COUNT, "description": "When it began, UTC [ns since 1970]."},
    task=_or_null(_ANY_TASK),
    title=TEXT,
    state={
        "type": "string",
        "enum": ["SUCCEEDED", "CANCELED", "ABORTED", "UNFINISHED", ""],
        "description": "`UNFINISHED` if it is being written or was cut off; empty if unknown.",
    },
    code=TEXT,
    message=TEXT,
    duration_s=_or_null(NUMBER),
    pinned=BOOLEAN,
)
TIMELINE = answer(
    "Timeline",
    name=RECORDING_NAME,
    began_s={**NUMBER, "description": "When the goal began, as in `time_s` of events."},
    duration_s=NUMBER,
)
_EVENT = {"type": "object", "required": ["event", "time_s"]}
WINDOW = answer(
    "Window",
    from_s=_CLOCK,
    to_s=_CLOCK,
    state={**array(_EVENT), "description": "Events that give the state before the window."},
    events=array(_EVENT),
    previous_s=_or_null({**_CLOCK, "description": "Last step of the run before the window."}),
    next_s=_or_null({**_CLOCK, "description": "First step of the run after the window."}),
)
_SAMPLES = _object(
    {
        "times_s": array(_CLOCK),
        "positions": {"type": "object", "additionalProperties": array(_or_null(NUMBER))},
    }
)
SERIES = answer(
    "Series",
    commanded=_SAMPLES,
    measured=_SAMPLES,
    lateness=_object({"times_s": array(_CLOCK), "late_s": array(NUMBER)}),
    velocity_limits=_BY_JOINT,
    events={**array({"type": "object"}), "description": "Progress, and lines of the log."},
)
VERIFICATION = answer(
    "Verification",
    holds=BOOLEAN,
    error=TEXT,
    code=TEXT,
    verdicts=array(
        _object({"question": TEXT, "holds": BOOLEAN, "words": TEXT, "source": TEXT}),
    ),
)
