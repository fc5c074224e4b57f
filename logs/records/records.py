"""The types of records of a run. Each record describes one event.

`time` is always on the program's monotonic clock [s]. Joint positions are *commanded* [rad], except
in `Measured` and `LeaderState`. The table in `topics.py` defines the messages of each record.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from hardware.loading.dataclass import dataclass
from hardware.printable import wire_text

# Names of measured quantities.
QUANTITIES = ("position", "velocity", "effort", "temperature", "voltage", "current", "lost")
MOVE = -1  # task number of a move, because a move has no task file
_AT_ONCE = 0.1  # a goal that starts within this time counts as not queued [s]


def goal_title(task: int, name: str = "") -> str:
    """Return the title of a goal for people, such as `task 1 wave` or `move folded`.

    Args:
        task: Number of the task; `MOVE` for a move.
        name: Name of the task, or description of the move; empty if unknown.
    """
    return name or "move" if task == MOVE else f"task {task} {name}".rstrip()


@dataclass(frozen=True, slots=True)
class Description:
    """The robot's URDF, recorded at `time` [s]. Later transforms are computed from this URDF."""

    time: float
    urdf: str


@dataclass(frozen=True, slots=True)
class Sent:
    """A frame or board setting that was written to the port. A setting commands no joint.

    Attributes:
        time: Time of writing [s].
        data: The bytes.
        scheduled: Planned time [s]; None for a frame without a schedule.
        hold: True if the frame is a hold: a stop repeated the previous frame.
        joints: Names of the commanded joints, (J,); empty for a setting.
        positions: Commanded positions [rad], (J,).
    """

    time: float
    data: bytes
    scheduled: float | None
    hold: bool
    joints: tuple[str, ...]
    positions: tuple[float, ...]

    @property
    def text(self) -> str:
        """The bytes as a str: ASCII text, or hexadecimal digits if they are not ASCII text."""
        return wire_text(self.data)


@dataclass(frozen=True, slots=True)
class Received:
    """Bytes that the board sent, at `time` [s]."""

    time: float
    data: bytes


@dataclass(frozen=True, slots=True)
class Measured:
    """A measurement of the joints by the board. Values that it does not measure are empty.

    Attributes:
        time: Time of reading [s].
        joints: Names of the actuated joints, (J,).
        position: Measured positions [rad], (J,).
        velocity: Measured velocities [rad/s], (J,).
        effort: Measured shares of the largest torque of the servos, -1 to 1, (J,).
        temperature: Temperatures of the servos [C], (J,).
        voltage: Supply voltages of the servos [V], (J,).
        current: Currents of the servos [A], (J,).
        lost: Numbers of lost answers of the servos since the port was opened, (J,).
    """

    time: float
    joints: tuple[str, ...]
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]
    temperature: tuple[float, ...]
    voltage: tuple[float, ...]
    current: tuple[float, ...]
    lost: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LeaderState:
    """Positions of the leader, the hand-guided arm that this arm follows, at one step.

    Attributes:
        time: Time of the step [s].
        joints: Names of the actuated joints, (J,).
        positions: Measured positions of the leader [rad], (J,).
    """

    time: float
    joints: tuple[str, ...]
    positions: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Transition:
    """A transition of the hardware's lifecycle, or the state in which a recording begins.

    Attributes:
        time: Time of the transition [s].
        label: The transition, such as `activate` or `transition_success`. Empty if nothing changed:
            both states are then the state at the start of the recording.
        start: The state before.
        goal: The state after.
    """

    time: float
    label: str
    start: str
    goal: str


@dataclass(frozen=True, slots=True)
class Goal:
    """An accepted goal.

    Attributes:
        time: Time at which the goal started [s]; in a server's own recording, time at which the
            goal was accepted.
        goal_id: UUID, 32 hexadecimal digits.
        task: Number of the requested task; -1 for a move.
        name: Name of the task; empty if there is no such task. For a move, a description of the
            move, such as `move folded`.
        seed: Seed of the planners; 0 if the goal has a separate recording.
        start: Commanded position of every actuated joint [rad], by name; empty if the arm was not
            active.
    """

    time: float
    goal_id: str
    task: int
    name: str
    seed: int
    start: Mapping[str, float] = field(default_factory=dict)

    @property
    def elsewhere(self) -> bool:
        """True if the goal has a separate recording, and the server's recording only names it."""
        return not self.seed


@dataclass(frozen=True, slots=True)
class Feedback:
    """Progress of a goal.

    Attributes:
        time: Time of the report [s].
        goal_id: UUID, 32 hexadecimal digits.
        percentage: Share of executed frames [%]; None before the first schedule.
        phase: Phase of the run, such as `planning`.
        node: Name of the tree's running node.
        attempt: Number of the attempt, from 1. Within one attempt, the percentage never decreases.
    """

    time: float
    goal_id: str
    percentage: int | None
    phase: str
    node: str
    attempt: int = 1

    @property
    def paused(self) -> bool:
        """True if the goal is paused."""
        return self.phase == "paused"


@dataclass(frozen=True, slots=True)
class Result:
    """The end of a goal.

    Attributes:
        time: Time of the end [s].
        goal_id: UUID, 32 hexadecimal digits.
        task: Number of the task; -1 for a move.
        state: Final state of the goal: `SUCCEEDED`, `ABORTED` or `CANCELED`.
        success: True if the task succeeded.
        code: Stable code of the cause of the end.
        message: Cause of the end, in words.
        frames: Number of frames sent.
        duration: Time from the acceptance of the goal to its end, including time in the queue [s].
        node: Path of the node that caused the end; empty if no node caused it.
        joint: Joint that the cause concerns; empty if unknown.
        value: The wrong value: a position [rad], a distance [m], or a time [s].
        limit: The limit of that value, in the same unit.
        hint: Advice for the user.
        place: Place in the task file of a node that was rejected before the run, and the places
            that refer to this node; empty if no node was rejected.
        argument: Name of the argument that has a wrong value; empty if no argument is wrong.
    """

    time: float
    goal_id: str
    task: int
    state: str
    success: bool
    code: str
    message: str
    frames: int
    duration: float
    node: str = ""
    joint: str = ""
    value: float | None = None
    limit: float | None = None
    hint: str = ""
    place: str = ""
    argument: str = ""

    def queued(self, goal: Goal) -> float:
        """Return how long a goal waited in the queue [s]; 0 if the goal started at once.

        Args:
            goal: The goal that ended with this result.
        """
        waited = self.duration - (self.time - goal.time)
        return waited if waited > _AT_ONCE else 0.0


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """A change of the status of a node in the tree.

    Attributes:
        time: Time of the tick [s].
        path: Path of the node in the tree.
        name: Name of the node.
        status: New status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        message: Feedback message of the node.
        inputs: Values that the node has read from keys and parameters since its start, by port.
            The values are texts for people.
    """

    time: float
    path: str
    name: str
    status: str
    message: str
    inputs: Mapping[str, str] = field(default_factory=dict)


HALTED = "HALTED"  # shown to people in place of INVALID, if the node was RUNNING before


def shown_status(status: str, before: str) -> str:
    """Return the status of a node for people: `HALTED` if the node was interrupted.

    Args:
        status: Recorded status of the node.
        before: Previous status of the node; empty if there is none.
    """
    return HALTED if status == "INVALID" and before == "RUNNING" else status


@dataclass(frozen=True, slots=True)
class Plan:
    """A query to a planner, and the planner's answer.

    The shapes have N samples, W waypoints, V via points and J joints.

    Attributes:
        time: Time of the planner's answer [s].
        group: Group of joints, such as `arm`.
        joints: Names of the joints of the group, (J,).
        start: Start position of every actuated joint of the robot [rad], by name. Joints of other
            groups do not move.
        goal: Goal positions [rad], (J,).
        via: Positions that the motion passes on its way to the goal [rad], (V, J).
        world: Bodies around the arm and in its gripper [m]. A body has a `name` and a shape: a
            `box` with `size`, a `sphere` with `radius`, a `cylinder` with `radius` and `length`, or
            a `mesh` with `path` and `scale`. Its `position` (of the centre) and `rotation` (x, y,
            z, w) are in the frame of its `link`; an empty link is the root. `touches` has the names
            of links and bodies that the body may touch.
        seed: Seed of the planner.
        velocity_limits: Velocity limits [rad/s], (J,).
        acceleration_limits: Acceleration limits [rad/s²], (J,).
        waypoints: Corners of the path [rad], (W, J).
        times: Time of each sample, from the start of the motion [s], (N,).
        positions: The sampled motion [rad], (N, J).
        duration: Duration of the motion [s].
        milliseconds: Duration of each step of planning [ms], by name of the step.
        code: Stable code of a failure; empty if a motion was found.
        message: The failure in words.
        spare: Distance from obstacles that the path keeps in addition to the robot's margin [m].
            Start, via points and goal keep only the margin.
        speed: Share of the robot's speed, at most 1. The velocity limits are multiplied by this
            share, and the acceleration limits by its square.
    """

    time: float
    group: str
    joints: tuple[str, ...]
    start: dict[str, float]
    goal: tuple[float, ...]
    via: tuple[tuple[float, ...], ...]
    world: tuple[dict[str, Any], ...]
    seed: int
    velocity_limits: tuple[float, ...]
    acceleration_limits: tuple[float, ...]
    waypoints: tuple[tuple[float, ...], ...]
    times: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    duration: float
    milliseconds: dict[str, float]
    code: str
    message: str
    spare: float = 0.0
    speed: float = 1.0


@dataclass(frozen=True, slots=True)
class Schedule:
    """The frames of a compiled motion. The shapes have N frames, K samples and J joints.

    The frames depend only on the samples, so they can be compiled again from a recording.

    Attributes:
        time: Time of compilation [s].
        rate_hz: Rate at which the motion was sampled [Hz].
        firmware: Name of the firmware profile, which limits the rate of frames.
        times: Planned time of each frame, from the start of the motion [s], (N,).
        frames: Texts of the frames, (N,).
        delays_s: Delay of each frame, because the board accepts frames at a limited rate [s], (N,).
        slowed_s: Time added to the motion, because the board accepts frames at a limited rate [s].
        start: Start position of every actuated joint [rad], by name.
        duration: Duration of the planned motion [s].
        groups: Groups of the merged plans, in order; empty for frames that were not planned.
        together: True if the groups move at the same time.
        sample_times: Time of each sample, from the start of the motion [s], (K,).
        samples: Positions of all actuated joints [rad], (K, J).
        resumed: Time in the interrupted motion from which this schedule continues it [s]; None if
            the schedule starts a motion at its beginning.
    """

    time: float
    rate_hz: float
    firmware: str
    times: tuple[float, ...]
    frames: tuple[str, ...]
    delays_s: tuple[float, ...]
    slowed_s: float
    start: dict[str, float]
    duration: float
    groups: tuple[str, ...]
    together: bool
    sample_times: tuple[float, ...]
    samples: tuple[tuple[float, ...], ...]
    resumed: float | None = None


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of the program's log at `time` [s]. `level` is a level of Python's `logging`."""

    time: float
    level: int
    logger: str
    message: str


@dataclass(frozen=True, slots=True)
class Attachment:
    """A named file, such as the task's YAML file. Its time is the time of the previous record."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Note:
    """A named set of values by key, such as the versions of libraries."""

    name: str
    facts: Mapping[str, str]


# Types that `Recording.records` yields. The robot's description is an attachment.
RunRecord = (
    Sent
    | Received
    | Measured
    | LeaderState
    | Transition
    | Goal
    | Feedback
    | Result
    | NodeStatus
    | Plan
    | Schedule
    | LogLine
)
Record = Description | RunRecord
Item = Record | Attachment | Note
