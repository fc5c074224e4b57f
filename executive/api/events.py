"""Reports of the executive: events as they happen, and its status at one moment.

`--json`, the server and its clients use the same JSON for both.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any, cast

import logs
from executive.api import Policy
from hardware import State
from hardware.joints import joint_words
from hardware.loading.dataclass import dataclass
from hardware.printable import wire_bytes, wire_text
from logs.records.field_types import frozen

from .outcome import Cause, GoalStatus, from_fields

if TYPE_CHECKING:
    from hardware import Measurement, Robot


@dataclass(frozen=True, slots=True)
class QuestionStatus:
    """State of a question to the operator.

    Attributes:
        time: Time of this state [s].
        question_id: 8 hexadecimal digits.
        text: Text of the question.
        choices: Allowed answers; empty if any text is allowed.
        open: True while the question waits for its answer.
    """

    time: float
    question_id: str
    text: str
    choices: tuple[str, ...]
    open: bool

    def text_with_command(self) -> str:
        """Return the question, and the command that answers it."""
        choices = f" [{'/'.join(self.choices)}]" if self.choices else ""
        return f"? {self.text}{choices}  (armtree answer {self.question_id} WORDS)"


Event = logs.Record | GoalStatus | QuestionStatus

EVENTS: dict[type, str] = {
    logs.Goal: "goal",
    logs.Sent: "sent",
    logs.Received: "received",
    logs.Measured: "measured",
    logs.Transition: "lifecycle",
    logs.Feedback: "feedback",
    logs.NodeStatus: "node",
    logs.Plan: "plan",
    logs.Schedule: "schedule",
    logs.LogLine: "log",
    QuestionStatus: "question",
}
STATUS = "status"
KINDS = frozenset({STATUS, *EVENTS.values()})

# Names in JSON of fields whose unit is not in their name.
UNITS = {each: f"{each}_s" for each in ("boot_wait", "duration", "scheduled", "time", "uptime")}

_RECORDS = {name: kind for kind, name in EVENTS.items()}
_FIELDS = {unit: name for name, unit in UNITS.items()}


@dataclass(frozen=True, slots=True)
class Status:
    """Status of the executive at one moment.

    Attributes:
        arm: State of the hardware. It can be compared with its name, such as `active`.
        fault: Fault that took the arm out of *active*; None after the next activation.
        port: Serial port of the board; empty if there is none.
        commanded: Last commanded position by joint [rad]; None if the arm is not active.
        measured: Measured position by joint [rad]; None if the arm is not active, or its board
            measures none.
        goal: Goal under way; None if there is none.
        percentage: Progress of that goal [%]; None if unknown.
        phase: Phase of the goal, such as `planning`.
        node: Name of the running node.
        attempt: Number of the attempt, from 1. Each retry in the tree adds 1.
        waiting: Identities of the goals in the queue.
        policy: Policy for a second goal.
        paused: True if the goal under way is paused.
        breakpoints: Paths of the nodes with a breakpoint.
        stops: Number of stops since the start. Stops of an idle arm count, too.
        uptime: Time since the start [s].
        time: Time of this status, on the clock of the events [s].
    """

    arm: State
    fault: Cause | None
    port: str
    commanded: Mapping[str, float] | None
    measured: Mapping[str, float] | None
    goal: GoalStatus | None
    percentage: int | None
    phase: str
    node: str
    attempt: int
    waiting: tuple[str, ...]
    policy: Policy
    paused: bool
    breakpoints: tuple[str, ...]
    stops: int
    uptime: float
    time: float

    def to_json(self) -> dict[str, Any]:
        """Return the status as a JSON object."""
        goal = self.goal and self.goal.to_json()
        return _by_json_name(self) | {"goal": goal, "uptime_s": round(self.uptime, 3)}

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "Status":
        """Return the status from the result of `to_json`.

        Raises:
            KeyError: A key is missing.
        """
        values = {
            **_by_field_name(plain),
            "arm": State(plain["arm"]),
            "fault": plain["fault"] and Cause.from_json(plain["fault"]),
            "goal": plain["goal"] and GoalStatus.from_json(plain["goal"]),
            "waiting": tuple(plain["waiting"]),
            "policy": Policy(plain["policy"]),
            "breakpoints": tuple(plain["breakpoints"]),
        }
        return from_fields(cls, values)


@dataclass(frozen=True, slots=True)
class Where:
    """The position of the arm, and data to draw it. `Where()` is empty.

    Attributes:
        arm: State of the hardware.
        units: Unit of each actuated joint, `rad` or `m`, by name.
        limits: Smallest and largest position of each actuated joint, in its unit, by name; None for
            a joint without limits.
        boot_wait: Time from opening the port until the board is ready [s].
        commanded: Last commanded position by joint [rad]; None if the arm is not active.
        tool: x, y, z of the tool at the commanded position, in the frame of the robot's root [m];
            None if the arm is not active, or its robot file names no tool.
        width: Distance between the fingers at the commanded position [m]; None if the arm is not
            active, or its robot file has no `pads`.
        turns: The turns of the tool that the arm can make while the tool stays at its point:
            `roll`, `pitch` and `yaw`, or fewer.
        gripper: True if the arm has a gripper.
        measured: Measured position by joint [rad]; None if the arm is not active, or its board
            measures none. The next six attributes are None in the same cases.
        measured_velocity: Measured velocity by joint [rad/s].
        measured_effort: Measured share of the largest torque of the servo by joint, -1 to 1.
        temperature: Temperature of the servo by joint [C].
        voltage: Voltage of the servo's supply by joint [V].
        current: Current of the servo by joint [A].
        lost: Number of lost answers of the servo since the port was opened, by joint.
    """

    arm: State = State.UNCONFIGURED
    units: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float] | None] = field(default_factory=dict)
    boot_wait: float = 0.0
    commanded: Mapping[str, float] | None = None
    tool: tuple[float, float, float] | None = None
    width: float | None = None
    turns: tuple[str, ...] = ()
    gripper: bool = False
    measured: Mapping[str, float] | None = None
    measured_velocity: Mapping[str, float] | None = None
    measured_effort: Mapping[str, float] | None = None
    temperature: Mapping[str, float] | None = None
    voltage: Mapping[str, float] | None = None
    current: Mapping[str, float] | None = None
    lost: Mapping[str, float] | None = None

    @classmethod
    def of(
        cls,
        robot: "Robot",
        arm: State,
        commanded: Mapping[str, float] | None,
        measured: "Measurement | None" = None,
    ) -> "Where":
        """Return the position of a robot's arm.

        Args:
            robot: The robot.
            arm: State of the hardware.
            commanded: Last commanded position by joint [rad]; None if unknown.
            measured: Last measurement, or None.
        """
        values = dataclasses.astuple(measured) if measured else ()
        return cls(
            arm,
            {joint.name: joint.unit for joint in robot.actuated},
            {joint.name: _finite(joint.lower, joint.upper) for joint in robot.actuated},
            robot.serial.boot_wait,
            commanded,
            robot.tool_position(commanded) if commanded else None,
            robot.width(commanded) if commanded else None,
            robot.turns(),
            bool(robot.groups["gripper"]),
            *(robot.by_joint(each) if each else None for each in values),
        )

    def words(self, positions: Mapping[str, float]) -> str:
        """Return positions by joint [rad] for people, as `joint_1 70.0 deg, joint_2 0.0 deg`."""
        return joint_words(positions, self.units)

    @property
    def tool_words(self) -> str:
        """The position of the tool for people, as `120.0, 0.0, 85.5 mm`; empty if unknown."""
        shown = (f"{1e3 * q:z.1f}" for q in self.tool or ())
        return f"{', '.join(shown)} mm" if self.tool else ""

    @property
    def width_words(self) -> str:
        """The width of the gripper for people, as `20.0 mm`; empty if unknown."""
        return "" if self.width is None else f"{1e3 * self.width:.1f} mm"

    def to_json(self) -> dict[str, Any]:
        """Return the position as a JSON object."""
        return _by_json_name(self)

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "Where":
        """Return the position from the result of `to_json`.

        Raises:
            KeyError: A key is missing.
        """
        values = {
            **_by_field_name(plain),
            "arm": State(plain["arm"]),
            "limits": {name: pair and tuple(pair) for name, pair in plain["limits"].items()},
            "tool": plain["tool"] and tuple(plain["tool"]),
            "turns": tuple(plain["turns"]),
        }
        return from_fields(cls, values)


def _finite(lower: float, upper: float) -> tuple[float, float] | None:
    return (lower, upper) if math.isfinite(upper - lower) else None


def _by_json_name(value: Any) -> dict[str, Any]:
    return {UNITS.get(name, name): each for name, each in dataclasses.asdict(value).items()}


def _by_field_name(plain: Mapping[str, Any]) -> dict[str, Any]:
    return {_FIELDS.get(key, key): each for key, each in plain.items()}


def kind_of(event: Event) -> str:
    """Return the name of an event; empty if the event is recorded but not published."""
    return STATUS if isinstance(event, GoalStatus) else EVENTS.get(type(event), "")


def event_to_json(event: Event) -> dict[str, Any]:
    """Return an event as a JSON object. It must have a name: see `kind_of`."""
    if isinstance(event, GoalStatus):
        return {"event": STATUS, **event.to_json()}
    fields = _by_json_name(event)
    for key, value in fields.items():
        if isinstance(value, bytes):
            fields[key] = wire_text(value)
    return {"event": EVENTS[type(event)], **fields}


def event_from_json(plain: Mapping[str, Any]) -> Event:
    """Return an event from the result of `event_to_json`.

    Raises:
        KeyError: The object is not an event, or it is an event of another version.
    """
    if plain["event"] == STATUS:
        return GoalStatus.from_json(plain)
    values = {key: frozen(value) for key, value in _by_field_name(plain).items()}
    if "data" in values:
        values["data"] = wire_bytes(values["data"])
    return cast("Event", from_fields(_RECORDS[plain["event"]], values))
