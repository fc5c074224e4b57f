"""The answers of tools: words for the model, and JSON of tasks and runs."""

from collections.abc import Iterator, Mapping
from typing import Any

from executive.api.codes import OK
from executive.api.outcome import GoalStatus
from executive.client.values import OpenQuestion, Task
from executive.code_table import look_up
from logs import goal_title

_JSON_TYPES = {
    "number": "number",
    "integer": "integer",
    "boolean": "boolean",
    "text": "string",
    "positions": ["object", "string"],
}


def arguments_schema(task: Task) -> dict[str, Any]:
    """Return the JSON Schema of a task's arguments."""
    return {
        "type": "object",
        "properties": {name: _property(each) for name, each in task.inputs.items()},
        "required": [name for name, each in task.inputs.items() if each["needed"]],
        "additionalProperties": False,
    }


def _property(declared: Mapping[str, Any]) -> dict[str, Any]:
    kind, unit = declared["type"], declared["unit"]
    plain = kind.removeprefix("list of ")
    one: dict[str, Any] = {"type": _JSON_TYPES.get(plain, ["number", "string"])}
    found = {"type": "array", "items": one} if kind != plain else one
    limits = {"minimum": declared["least"], "maximum": declared["most"]}
    one |= {name: value for name, value in limits.items() if value is not None}
    if declared["choices"]:
        one["enum"] = declared["choices"]
    if declared["default"]:
        found["default"] = declared["default"]
    in_unit = f" A number is in {unit}; a text names its unit." if unit else ""
    found["description"] = f"{declared['description'] or plain}.{in_unit}".replace("..", ".")
    return found


def goal_words(
    goal: GoalStatus, questions: tuple[OpenQuestion, ...] = (), paused: bool = False
) -> str:
    """Return the state of a goal in words.

    Args:
        goal: The goal.
        questions: Open questions of tasks.
        paused: True if the goal is paused.
    """
    if goal.outcome:
        return f"{goal.outcome.text()}\ngoal {goal.identity}"
    state = "PAUSED" if paused else goal.state.name
    lines = [f"{goal_title(goal.task)} {state}, goal {goal.identity}"]
    lines += [
        f"The goal waits for a person: {each.text}{' or '.join(each.choices) and ' '}"
        f"{'/'.join(each.choices)}. The person answers on the page (`armtree view`), or with "
        f"`armtree answer {each.question_id} WORDS`. Do not answer for the person."
        for each in questions
    ]
    return "\n".join([*lines, "goal_state waits for the end; stop cancels it"])


def run_lines(row: Mapping[str, Any], window: Mapping[str, Any]) -> Iterator[str]:
    """Explain the end of a recorded run, line by line.

    Args:
        row: Row of the run in the list of recordings.
        window: The events around the end of the run, with the state before them.
    """
    title = row["title"] or row["name"]
    yield f"{title} {row['state'] or 'of unknown state'} after {row['duration_s'] or 0:.2f} s"
    events = [*window["state"], *window["events"]]
    nodes = {each["path"]: each for each in events if each["event"] == "node"}
    result = next((each["result"] for each in reversed(events) if each.get("result")), None)
    cause = (result or {}).get("cause")
    if cause:
        yield f"{cause['message']} [{cause['code']}]"
        yield from (
            f"{key} {cause[key]}"
            for key in ("node", "place", "argument", "joint", "value", "limit")
            if cause[key]
        )
        if cause["hint"]:
            yield f"-> {cause['hint']}"
    elif row["code"] not in ("", OK):
        yield f"{row['message']} [{row['code']}]"
        yield f"-> {look_up(row['code']).hint}"
    for path, node in nodes.items():
        if node["status"] == "FAILURE":
            yield f"failed: {path}{': ' if node['message'] else ''}{node['message']}"
    yield from (
        f"log: {each['message']}"
        for each in events
        if each["event"] == "log" and each["level"] >= 30
    )
