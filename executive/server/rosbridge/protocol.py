"""The part of the rosbridge protocol for one action server, without a network.

The reference is ROSBRIDGE_PROTOCOL.md of RobotWebTools/rosbridge_suite. A message is one JSON
object. The client chooses `id`, which every answer to the message repeats.
"""

import base64
import binascii
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from executive.api import strict_json
from executive.api.joint_state import JointState
from hardware.loading.dataclass import dataclass

ACTION = "/task_server"
ACTION_TYPE = "arduinobot_msgs/action/ArduinobotTask"
JOINT_STATES = "/joint_states"
STATUS = f"{ACTION}/_action/status"
CANCEL_SERVICE = f"{ACTION}/_action/cancel_goal"
TOPICS = {JOINT_STATES: "sensor_msgs/msg/JointState", STATUS: "action_msgs/msg/GoalStatusArray"}

_MAX_TASK = 2**31 - 1
_MAX_TEXT = 1024  # largest number of characters of an id or a name
_MAX_ERROR = 300  # largest number of characters of an error, because it may quote the client
# Clients also send these operations. An action server ignores them.
_IGNORED = {"advertise", "unadvertise", "publish", "set_level", "unadvertise_action", "auth"}


class BadMessage(Exception):
    """A message that is invalid or cannot be executed.

    Args:
        text: The mistake in words.
        identity: The `id` of the message, or None if it has none.
    """

    def __init__(self, text: str, identity: str | None = None) -> None:
        super().__init__(text if len(text) <= _MAX_ERROR else f"{text[:_MAX_ERROR]} …")
        self.identity = identity


class BadGoal(BadMessage):
    """A goal that this server cannot accept. Its client gets the error as the result."""


class BadCall(BadMessage):
    """A service call that cannot be executed. Its client gets the error as the response."""

    def __init__(self, text: str, call: "CallService") -> None:
        super().__init__(text, call.identity)
        self.call = call


@dataclass(frozen=True, slots=True)
class SendGoal:
    """Run a task, and send feedback if `feedback` is true."""

    identity: str
    task: int
    feedback: bool


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """Cancel a goal of this connection."""

    identity: str


@dataclass(frozen=True, slots=True)
class CallService:
    """Call a service. `CANCEL_SERVICE` is the only one."""

    identity: str | None
    service: str
    arguments: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Subscribe:
    """Send a topic to one subscriber, at most once per `period` [s]."""

    topic: str
    period: float
    identity: str | None = None


@dataclass(frozen=True, slots=True)
class Unsubscribe:
    """End one subscription of a topic, or all of this client if `identity` is None."""

    topic: str
    identity: str | None = None


Message = SendGoal | CancelGoal | CallService | Subscribe | Unsubscribe | None


def parse(text: str | None) -> Message:
    """Read a message.

    Args:
        text: The message, or None for a binary message.

    Returns:
        The message, or None if it can be ignored.

    Raises:
        BadMessage: The message cannot be understood.
        BadGoal: The message is a goal that cannot be understood.
        BadCall: The message is a service call that cannot be understood.
    """
    if text is None:
        raise BadMessage("a message must be JSON text, not binary")
    try:
        message = strict_json.parse(text)
    except strict_json.NotJson as error:
        raise _unreadable(text, f"invalid JSON: {error}") from error
    if not isinstance(message, dict):
        raise BadMessage("a message must be a JSON object")
    operation, identity = message.get("op"), message.get("id")
    if identity is not None:
        _text(message, "id")
    if not isinstance(operation, str) or operation not in _IGNORED | _READERS.keys():
        raise BadMessage(f"op {operation!r} is unknown", identity)
    return None if operation in _IGNORED else _READERS[operation](message)


def _unreadable(text: str, why: str) -> BadMessage:
    """Return the error for text that is not strict JSON, with the id for its client."""
    with suppress(ValueError, RecursionError, AttributeError, BadMessage):
        message = json.loads(text, parse_int=float)  # int refuses numbers of 4,300 digits
        operation, identity = message.get("op"), _text(message, "id")
        if operation == "send_action_goal":
            return BadGoal(why, identity)
        if operation == "call_service":
            return BadCall(why, CallService(identity, _slashed(_text(message, "service")), {}))
    return BadMessage(why)


def _send_goal(message: dict[str, Any]) -> SendGoal:
    identity = _text(message, "id") if "id" in message else ""
    if _slashed(message.get("action")) != ACTION:
        raise BadGoal(f"no action {message.get('action')!r}; the only action is {ACTION}", identity)
    if not _same_type(message.get("action_type"), ACTION_TYPE):
        raise BadGoal(
            f"{ACTION} is of type {ACTION_TYPE}, not {message.get('action_type')!r}", identity
        )
    if message.get("compression", "none") != "none" or message.get("fragment_size") is not None:
        raise BadGoal("compression and fragments are not supported", identity)
    arguments = message.get("args") or {}
    if isinstance(arguments, list):  # values in the order of the fields; there is only one field
        arguments = {"task_number": arguments[0]}
    if not isinstance(arguments, dict) or not {"task_number"}.issuperset(arguments):
        raise BadGoal("args of a goal must be {task_number: N}, [N], or empty for 0", identity)
    task, feedback = arguments.get("task_number", 0), message.get("feedback", False)
    if type(task) is not int or not -_MAX_TASK - 1 <= task <= _MAX_TASK:
        raise BadGoal(f"task_number {task!r} is not an int32", identity)
    if not isinstance(feedback, bool):
        raise BadGoal(f"feedback must be true or false, not {feedback!r}", identity)
    return SendGoal(identity, task, feedback)


def _cancel_goal(message: dict[str, Any]) -> CancelGoal:
    identity = _text(message, "id")
    if _slashed(message.get("action")) != ACTION:
        raise BadMessage(
            f"no action {message.get('action')!r}; the only action is {ACTION}", identity
        )
    return CancelGoal(identity)


def _call_service(message: dict[str, Any]) -> CallService:
    identity = message.get("id")
    service, arguments = _slashed(_text(message, "service")), message.get("args") or {}
    if not isinstance(arguments, dict):
        raise BadCall("args of a service must be an object", CallService(identity, service, {}))
    return CallService(identity, service, arguments)


def _subscribe(message: dict[str, Any]) -> Subscribe:
    identity, topic = message.get("id"), _slashed(_text(message, "topic"))
    if topic not in TOPICS:
        raise BadMessage(f"no topic {topic}; there are {', '.join(TOPICS)}", identity)
    kind = message.get("type")
    if kind is not None and not _same_type(kind, TOPICS[topic]):
        raise BadMessage(f"{topic} is of type {TOPICS[topic]}, not {kind!r}", identity)
    throttle = message.get("throttle_rate", 0)
    if type(throttle) not in (int, float) or not 0 <= throttle <= 3_600_000:
        raise BadMessage(f"throttle_rate {throttle!r} is not a time from 0 to 3600000 ms", identity)
    return Subscribe(topic, throttle / 1000.0, identity)


def _unsubscribe(message: dict[str, Any]) -> Unsubscribe:
    return Unsubscribe(_slashed(_text(message, "topic")), message.get("id"))


_READERS: dict[str, Callable[[dict[str, Any]], Message]] = {
    "send_action_goal": _send_goal,
    "cancel_action_goal": _cancel_goal,
    "call_service": _call_service,
    "subscribe": _subscribe,
    "unsubscribe": _unsubscribe,
}


def _text(message: Mapping[str, Any], key: str) -> str:
    value = message.get(key)
    if not isinstance(value, str) or not 0 < len(value) <= _MAX_TEXT:
        raise BadMessage(f"{key} {value!r} is not a text of 1 to {_MAX_TEXT} characters")
    return value


def _slashed(name: object) -> str:
    """Return a name with one leading slash."""
    return f"/{name.removeprefix('/')}" if isinstance(name, str) else ""


def _same_type(given: object, known: str) -> bool:
    """Return True if a type's name is `pkg/action/Name` or, as in ROS 1, `pkg/Name`."""
    package, _, name = known.split("/")
    return given in (known, f"{package}/{name}")


def result(identity: str, status: int, success: bool) -> str:
    """Return the result of an accepted goal; status is 4 SUCCEEDED, 5 CANCELED or 6 ABORTED."""
    return _result(identity, values={"success": success}, status=status, done=True)


def refusal(identity: str, why: str) -> str:
    """Return the answer to a refused goal. Clients treat it as an error."""
    return _result(identity, values=why, status=0, done=False)


def feedback(identity: str, percentage: int) -> str:
    """Return the progress of a goal [%]. It must not be sent after the result."""
    return _dump(
        op="action_feedback", id=identity, action=ACTION, values={"percentage": percentage}
    )


def published(topic: str, message: Mapping[str, Any]) -> str:
    """Return a message on a topic."""
    return _dump(op="publish", topic=topic, msg=message)


def service_response(call: CallService, values: object, done: bool) -> str:
    """Return the answer to a service call."""
    named = {} if call.identity is None else {"id": call.identity}
    return _dump(op="service_response", service=call.service, values=values, result=done, **named)


def error_status(error: BadMessage) -> str:
    """Return the answer to a message that cannot be understood."""
    named = {} if error.identity is None else {"id": error.identity}
    return _dump(op="status", level="error", msg=str(error), **named)


def joint_state(utc_ns: int, state: JointState) -> dict[str, Any]:
    """Return a sensor_msgs/JointState."""
    return {
        "header": {"stamp": stamp(utc_ns), "frame_id": state.frame_id},
        "name": list(state.position),
        "position": list(state.position.values()),
        "velocity": list(state.velocity.values()),
        "effort": list(state.effort.values()),
    }


def goal_status(identity: str, stamp_ns: int, status: int) -> str:
    """Return an action_msgs/GoalStatus of a goal; `stamp_ns` is its time of acceptance [ns]."""
    return _dump(goal_info=_goal_info(identity, stamp_ns), status=status)


def status_array(goals: Iterable[str]) -> str:
    """Return a published action_msgs/GoalStatusArray.

    Args:
        goals: JSON of each status, from `goal_status`. It is encoded already, because there may be
            a thousand goals of which only one has changed.
    """
    empty = published(STATUS, {"status_list": []})
    return empty.replace("[]", f"[{','.join(goals)}]")


def cancel_request(call: CallService) -> tuple[str, int]:
    """Read a CancelGoal request.

    Returns:
        The goal id, empty for all goals, and the stamp [ns].

    Raises:
        BadCall: The arguments are not a CancelGoal request.
    """
    arguments = call.arguments
    try:
        info = arguments.get("goal_info", {})
        identity = _bytes(info.get("goal_id", {}).get("uuid", [0] * 16)).hex()
        at = info.get("stamp", {})
        seconds, nanoseconds = at.get("sec", 0), at.get("nanosec", 0)
        if type(seconds) is not int or type(nanoseconds) is not int or len(identity) != 32:
            raise ValueError(arguments)
    except (AttributeError, TypeError, ValueError) as error:
        raise BadCall("args are not an action_msgs/srv/CancelGoal request", call) from error
    return identity if any(bytes.fromhex(identity)) else "", seconds * 10**9 + nanoseconds


def cancel_response(code: int, goals: Sequence[tuple[str, int]]) -> dict[str, Any]:
    """Return a CancelGoal response.

    Args:
        code: Return code.
        goals: Id and stamp [ns] of every goal that is canceling.
    """
    return {"return_code": code, "goals_canceling": [_goal_info(*goal) for goal in goals]}


def stamp(time_ns: int) -> dict[str, int]:
    """Return a builtin_interfaces/Time."""
    return {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}


def _goal_info(identity: str, stamp_ns: int) -> dict[str, Any]:
    # The form in which rosbridge writes uint8[].
    uuid = base64.b64encode(bytes.fromhex(identity)).decode()
    return {"goal_id": {"uuid": uuid}, "stamp": stamp(stamp_ns)}


def _bytes(value: object) -> bytes:
    """Read a uint8[] from base64 or a list."""
    if isinstance(value, str):
        try:
            return base64.b64decode(value, validate=True)
        except binascii.Error as error:
            raise ValueError(value) from error
    if isinstance(value, list) and all(type(each) is int for each in value):
        return bytes(value)
    raise TypeError(value)


def _result(identity: str, *, values: object, status: int, done: bool) -> str:
    return _dump(
        op="action_result", id=identity, action=ACTION, values=values, status=status, result=done
    )


def _dump(**fields: object) -> str:
    return json.dumps(fields, allow_nan=False, separators=(",", ":"))
