"""JSON Schemas of the requests and answers of the server."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from enum import Enum
from inspect import cleandoc
from types import NoneType
from typing import Any, get_args, get_origin

from hardware import DISPLAY_UNITS, State
from hardware.loading.dataclass import dataclass

from .events import UNITS, Status, Where
from .outcome import CancelCode, Cause, GoalState, Outcome

Schema = Mapping[str, Any]

MAX_LISTED = 150  # largest number of goals in one answer


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
    """Return the schema of a request's body: an object with these keys and no others.

    Args:
        required: Keys that must be present.
        properties: Schema of every key.
    """
    schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**schema, "required": list(required)} if required else schema


def answer(name: str, /, **properties: Any) -> Component:
    """Return the schema of an answer: an object that has all of these keys."""
    return Component(name, _object(properties))


def described(schema: Any, description: str) -> dict[str, Any]:
    """Return a schema with a description."""
    return {**schema, "description": description}


def array(items: Any, **limits: int) -> dict[str, Any]:
    """Return the schema of a list. `limits` are further keys, such as `minItems`."""
    return {"type": "array", "items": items, **limits}


def integer(least: int, most: int) -> dict[str, Any]:
    """Return the schema of a whole number."""
    return {"type": "integer", "minimum": least, "maximum": most}


def number(least: float, most: float) -> dict[str, Any]:
    """Return the schema of a number."""
    return {"type": "number", "minimum": least, "maximum": most}


def choice(values: Iterable[Any], kind: str = "string") -> dict[str, Any]:
    """Return the schema of a value from a list of allowed values."""
    return {"type": kind, "enum": list(values)}


def text(pattern: str, most: int, title: str = "", **limits: int) -> dict[str, Any]:
    """Return the schema of a text with a pattern and a largest number of characters."""
    schema = {"type": "string", "pattern": pattern, "maxLength": most, **limits}
    return {"title": title, **schema} if title else schema


def by_name(values: Any) -> dict[str, Any]:
    """Return the schema of an object whose keys are names."""
    return {"type": "object", "additionalProperties": values}


def _object(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _or_null(schema: Any) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]}


def field_words(kind: type) -> dict[str, str]:
    """Return the description of each field of a dataclass, from its and its bases' docstrings."""
    docstrings = (cleandoc(each.__doc__ or "") for each in reversed(kind.__mro__))
    found = (pair for each in docstrings for pair in _ATTRIBUTE.findall(each))
    return {name: " ".join(words.split()) for name, words in found}


def _fields(kind: type, **others: Any) -> dict[str, Any]:
    """Return the schemas of a dataclass's fields, by their names in JSON.

    Args:
        kind: The dataclass. The types and the docstring make the schemas.
        others: Schemas that replace those of fields or add keys, by name in JSON.
    """
    words, schemas = field_words(kind), dict[str, Any]()
    for field in fields(kind):
        name = UNITS.get(field.name, field.name)
        meaning = words.get(field.name, "").replace("None", "null")
        given = others.pop(name) if name in others else _of_type(field.type)
        schemas[name] = {"description": meaning, **given}
    return schemas | others


def _of_type(kind: Any) -> Any:
    """Return the schema of the values of a type."""
    if kind in _TYPES:
        return _TYPES[kind]
    if isinstance(kind, type) and issubclass(kind, Enum):
        return choice(each.value for each in kind)
    inner = get_args(kind)
    if NoneType in inner:
        return _or_null(_of_type(inner[0]))
    if get_origin(kind) is Mapping:
        return by_name(_of_type(inner[1]))
    if inner[-1] is Ellipsis:
        return array(_of_type(inner[0]))
    return array(_of_type(inner[0]), minItems=len(inner), maxItems=len(inner))


TEXT = {"type": "string"}
NUMBER = {"type": "number"}
COUNT = {"type": "integer", "minimum": 0}
BOOLEAN = {"type": "boolean"}
_TYPES: dict[Any, Schema] = {str: TEXT, int: COUNT, float: NUMBER, bool: BOOLEAN}
_ATTRIBUTE = re.compile(r"^    (\w+): (.*(?:\n {5,}.*)*)", re.MULTILINE)  # in a docstring

GOAL_ID = text("^[0-9a-f]{32}$", 32, "32 lower-case hexadecimal digits", minLength=32)
QUESTION_ID = text("^[0-9a-f]{8}$", 8, minLength=8)
STAMP = integer(0, 2**63 - 1)
ARM_STATE = choice(state.value for state in State)

# Requests

EMPTY = body()
UNTIL = described(STAMP, "Cancel every goal accepted at or before this time [ns].")
TASK_NUMBER = described(integer(0, 2**31 - 1), "Number of the task.")
TASK_OR_NAME = {
    "title": "the number or the name of a task",
    "anyOf": [TASK_NUMBER, text("^[A-Za-z][A-Za-z0-9_-]*$", 250)],
    "description": "Number or name of the task.",
}
ARGUMENTS = {
    **by_name({"type": ["string", "number", "boolean", "array", "object"]}),
    "maxProperties": 64,
    "description": "Values of the task's parameters. A text is read as in a task file.",
}
_WORD = {"type": "string", "maxLength": 64, "minLength": 1}
TARGET = described(
    array({"anyOf": [_WORD, NUMBER]}, minItems=1, maxItems=64),
    "Words of `armtree move`: `joint_1=70deg`, `width=20mm` (gripper), poses, x, y, z of the "
    "tool [m], or `roll+=5deg`, `pitch+=5deg`, `yaw+=5deg` (turns of the tool).",
)
SPEED = described(number(0.01, 1), "Share of the robot's speed; default 1.")
MOMENT = number(0, 1e9)
START_POSE = described(
    choice(["boot", "last"]),
    "Pose of the arm at the activation, if its board does not reset: `boot` (of the robot file) or "
    "`last` (last commanded pose).",
)


def words(description: str) -> Schema:
    """Return the schema of a text of 1 to 1024 characters."""
    return {"type": "string", "maxLength": 1024, "minLength": 1, "description": description}


# Answers

ERROR = answer("Error", **_fields(Cause))
_ANY_TASK = described(
    integer(-(2**31), 2**31 - 1), "Task number; clients of rosbridge may send any int32."
)
RESULT = answer(
    "Result",
    goal_id=GOAL_ID,
    success=BOOLEAN,
    **_fields(
        Outcome,
        task=_ANY_TASK,
        state=choice(["SUCCEEDED", "CANCELED", "ABORTED"]),
        cause=_or_null(ERROR),
    ),
)
GOAL = answer(
    "Goal",
    goal_id=GOAL_ID,
    task=_ANY_TASK,
    state=choice(state.name for state in GoalState),
    stamp_ns=COUNT,
    result=_or_null(RESULT),
)
CANCELED = answer(
    "Canceled",
    return_code=described(
        choice((code.value for code in CancelCode), "integer"),
        "As in action_msgs/srv/CancelGoal: 0 none, 1 rejected, 2 unknown goal, 3 goal has ended.",
    ),
    goals=array(GOAL_ID),
)

_BY_JOINT = by_name(NUMBER)
_VECTOR = array(NUMBER, minItems=3, maxItems=3)
POSE = answer(
    "Pose",
    pose=TEXT,
    positions=_BY_JOINT,
    source=described(TEXT, "`FILE:LINE`, or `shipped`."),
)
STATUS = answer(
    "Status",
    **_fields(
        Status,
        fault=_or_null(ERROR),
        goal=_or_null(GOAL),
        percentage=_or_null(integer(0, 100)),
        waiting=array(GOAL_ID),
    ),
)
DIGEST = described(
    text("^([0-9a-f]{32}|[0-9a-f]{12}_[^/]+)$", 250, "the digest of a mesh"),
    "Digest of a mesh of the robot, or `path` of a body's mesh in a plan.",
)
_JOINT = _object(
    {
        "name": TEXT,
        "type": choice(["revolute", "continuous", "prismatic", "fixed"]),
        "unit": choice(DISPLAY_UNITS),
        "parent": TEXT,
        "child": TEXT,
        "xyz": _VECTOR,
        "rpy": _VECTOR,
        "axis": _VECTOR,
        "limits": described(array(NUMBER), "Smallest and largest position, if they are finite."),
        "mimic": {
            "type": ["array", "null"],
            "description": "The joint that it follows, the factor, and the offset.",
        },
    }
)
_SHAPE = _object(
    {
        "link": TEXT,
        "kind": choice(["box", "sphere", "cylinder", "mesh"]),
        "sizes": described(
            array(NUMBER),
            "Box: x, y, z. Sphere: radius. Cylinder: radius, length [m]. Mesh: scale.",
        ),
        "mesh": described(TEXT, "Digest for `/api/meshes`; empty for no mesh."),
        "xyz": _VECTOR,
        "rpy": _VECTOR,
        "color": _or_null(array(NUMBER, minItems=4, maxItems=4)),
    }
)
ROBOT = answer(
    "Robot",
    name=TEXT,
    opening=described(TEXT, "Effect of opening the port on the arm."),
    links=array(TEXT),
    joints=array(_JOINT),
    shapes=array(_SHAPE),
    groups=described(by_name(array(TEXT)), "Actuated joints of each group."),
    tool=_or_null(_object({"link": TEXT, "offset": _VECTOR})),
)
WHERE = answer("Where", **_fields(Where, units=by_name(choice(DISPLAY_UNITS))))
_INPUT = _object(
    {
        "type": TEXT,
        "unit": described(TEXT, "Unit of the limits; may be empty."),
        "units": described(
            by_name(NUMBER), "Factor from each allowed unit to the unit of the limits."
        ),
        "needed": BOOLEAN,
        "default": described(TEXT, "As in a task file; empty for none."),
        "least": _or_null(NUMBER),
        "most": _or_null(NUMBER),
        "choices": array(TEXT),
        "description": TEXT,
    }
)
TASK = answer(
    "Task",
    task=COUNT,
    name=TEXT,
    description=TEXT,
    source=TEXT,
    parameters=by_name(TEXT),
    inputs=by_name(_INPUT),
    wrong=TEXT,
    retry_safe=described(
        BOOLEAN, "True if the task may run again after a run with an unknown end, as in a fleet."
    ),
)
NODE = _object(
    {
        "path": TEXT,
        "kind": TEXT,
        "file": TEXT,
        "line": COUNT,
        "called_at": described(
            TEXT, "`FILE:LINE` that refers to the subtree, if this node is its root."
        ),
        "ports": by_name(TEXT),
    }
)
QUESTION = _object({"question_id": QUESTION_ID, "text": TEXT, "choices": array(TEXT)})
RECORDING_NAME = text(r"^[^/\\\x00-\x1f.][^/\\\x00-\x1f]*\.mcap$", 255, "the name of a recording")
_CLOCK = described(NUMBER, "Time from the beginning of the goal [s].")
RECORDING = answer(
    "Recording",
    name=RECORDING_NAME,
    bytes=COUNT,
    stamp_ns=described(COUNT, "Beginning of the recording, UTC [ns since 1970]."),
    task=_or_null(_ANY_TASK),
    title=TEXT,
    state=described(
        choice(["SUCCEEDED", "CANCELED", "ABORTED", "UNFINISHED", ""]),
        "`UNFINISHED` if the file is being written or was cut off; empty if unknown.",
    ),
    code=TEXT,
    message=TEXT,
    duration_s=_or_null(NUMBER),
    pinned=BOOLEAN,
)
TIMELINE = answer(
    "Timeline",
    name=RECORDING_NAME,
    began_s=described(NUMBER, "Beginning of the goal, on the clock of `time_s` of events [s]."),
    duration_s=NUMBER,
    ended={**BOOLEAN, "description": "False if the end of the run is not in the recording."},
)
_EVENT = {"type": "object", "required": ["event", "time_s"]}
WINDOW = answer(
    "Window",
    from_s=_CLOCK,
    to_s=_CLOCK,
    state=described(array(_EVENT), "Events that give the state before the window."),
    events=array(_EVENT),
    previous_s=_or_null(described(_CLOCK, "Time of the last step of the run before the window.")),
    next_s=_or_null(described(_CLOCK, "Time of the first step of the run after the window.")),
)
_SAMPLES = _object({"times_s": array(_CLOCK), "positions": by_name(array(_or_null(NUMBER)))})
SERIES = answer(
    "Series",
    commanded=_SAMPLES,
    measured=_SAMPLES,
    lateness=_object({"times_s": array(_CLOCK), "late_s": array(NUMBER)}),
    velocity_limits=_BY_JOINT,
    events=described(array({"type": "object"}), "Progress, and lines of the log."),
)
_VERDICT = _object(
    {
        "question": TEXT,
        "holds": BOOLEAN,
        "words": TEXT,
        "source": TEXT,
        "empty": described(BOOLEAN, "True if there was nothing to compare."),
    }
)
VERIFICATION = answer(
    "Verification", holds=BOOLEAN, error=TEXT, code=TEXT, verdicts=array(_VERDICT)
)
