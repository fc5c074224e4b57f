"""What a run leaves behind: one plain value per thing that happened.

`time` is always [s] on the monotonic clock that the program was given; joint positions are
*commanded* [rad], for the arm reports none. What becomes of each on disk is the table in
`topics.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

_AT_ONCE = 0.1  # a goal that starts within this time did not wait [s]


@dataclass(frozen=True, slots=True)
class Description:
    """The robot's URDF, at `time` [s]; the links are placed by the last one recorded."""

    time: float
    urdf: str


@dataclass(frozen=True, slots=True)
class Sent:
    """A frame that was written to the port, or a setting of the board, which commands no joint.

    Attributes:
        time: When it was written [s].
        data: The bytes.
        scheduled: When it was to be written [s], None for a frame without a schedule.
        hold: Whether it is the stop's repetition of the frame before.
        joints: Names of the commanded joints, (J,).
        positions: What the frame commands [rad], (J,).
    """

    time: float
    data: bytes
    scheduled: float | None
    hold: bool
    joints: tuple[str, ...]
    positions: tuple[float, ...]

    @property
    def text(self) -> str:
        """The bytes, to be read."""
        return self.data.decode("ascii", "backslashreplace")


@dataclass(frozen=True, slots=True)
class Received:
    """Bytes that came from the board, at `time` [s]."""

    time: float
    data: bytes


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of the hardware's lifecycle at `time` [s], or the state in which a recording begins.

    Attributes:
        label: The transition, such as `activate` or `transition_success`; empty where it is none,
            then both states are the one in which the recording begins.
        start: The state left.
        goal: The state reached.
    """

    time: float
    label: str
    start: str
    goal: str


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal was accepted.

    Attributes:
        time: When its turn came; in what a server records between runs, when it was accepted [s].
        goal_id: UUID, 32 hexadecimal digits.
        task: Number of the task asked for.
        name: Its name, empty where there is no such task.
        seed: Seed of the planners; 0 where a recording of its own tells of the goal.
    """

    time: float
    goal_id: str
    task: int
    name: str
    seed: int

    @property
    def elsewhere(self) -> bool:
        """Whether a recording of its own tells of it, and this one only that there was a goal."""
        return not self.seed


@dataclass(frozen=True, slots=True)
class Feedback:
    """How far a goal is.

    Attributes:
        time: When that was so [s].
        goal_id: UUID, 32 hexadecimal digits.
        percentage: Frames that arrived over frames scheduled [%]; None while none are.
        phase: What is going on, such as `planning`.
        node: Name of the tree's node at work.
        attempt: Which one it is, from 1; the percentage only grows within one.
    """

    time: float
    goal_id: str
    percentage: int | None
    phase: str
    node: str
    attempt: int = 1

    @property
    def paused(self) -> bool:
        """Whether the goal stands still."""
        return self.phase == "paused"


@dataclass(frozen=True, slots=True)
class Result:
    """How a goal ended.

    Attributes:
        time: When it ended [s].
        goal_id: UUID, 32 hexadecimal digits.
        task: Number of the task.
        state: `SUCCEEDED`, `ABORTED` or `CANCELED`.
        success: Whether the task was done.
        code: Stable name of the cause.
        message: The cause in words.
        frames: How many frames left.
        duration: From the acceptance of the goal to its end, the wait for its turn included [s].
        node: Path of the node that the cause came from; empty where there is none.
        joint: Which the cause concerns; empty where none is known.
        value: What was wrong: a position [rad], a distance [m], or a time [s].
        limit: What it is held against, in the same unit.
        hint: What to do next.
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

    def queued(self, goal: Goal) -> float:
        """Returns how long the goal waited in the queue [s]; 0 if it started at once."""
        waited = self.duration - (self.time - goal.time)
        return waited if waited > _AT_ONCE else 0.0


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """A node of the tree changed its status.

    Attributes:
        time: When it was ticked for that [s].
        path: The node's place in the tree.
        name: The node's name.
        status: `RUNNING`, `SUCCESS`, `FAILURE` or `INVALID`.
        message: The node's feedback.
    """

    time: float
    path: str
    name: str
    status: str
    message: str


@dataclass(frozen=True, slots=True)
class Plan:
    """What a planner made of a start and a goal; N samples, W waypoints, J joints.

    Attributes:
        time: When the planner answered [s].
        group: The joints' group, such as `arm`.
        joints: Their names, (J,).
        start: Where every actuated joint of the robot stood [rad], by name: those of other groups
            stand still meanwhile.
        goal: Where it is to end [rad], (J,).
        via: Points to pass on the way [rad], (V, J).
        world: The bodies around the arm and in its hand. Each has a `name`; a `box` with its
            `size`, a `sphere` with its `radius`, a `cylinder` with that and its `length`, or a
            `mesh` with its `path` and `scale`; a `position` of its centre and a `rotation`
            (x, y, z, w) in the frame of its `link`, empty for the root; what it `touches` [m].
        seed: Seed of the planner.
        velocity_limits: No joint goes faster [rad/s], (J,).
        acceleration_limits: Nor speeds up faster [rad/s²], (J,).
        waypoints: The path [rad], (W, J).
        times: When each sample is due, from the start of the motion [s], (N,).
        positions: The sampled motion [rad], (N, J).
        duration: Length of the motion [s].
        milliseconds: What each rung of the planning ladder took [ms].
        code: Stable name of the cause of a failure, empty where a motion was found.
        message: That cause in words.
        spare: Distance kept between the ends, beyond the robot's margin [m].
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


@dataclass(frozen=True, slots=True)
class Schedule:
    """The frames that a motion became; N frames, K samples, J joints.

    The samples are all that the frames were made of, so the frames can be made again from them.

    Attributes:
        time: When they were compiled [s].
        rate_hz: Grid the motion was sampled on [Hz].
        firmware: The profile the frames were spaced for.
        times: When each frame is due, from the start of the motion [s], (N,).
        frames: The frames as text, (N,).
        delays_s: How much later each is than planned, for the board's sake [s], (N,).
        slowed_s: By how much the board's pace stretched the motion [s].
        start: Where every actuated joint stood [rad], by name.
        duration: Of the motion as planned [s].
        groups: Whose plans were merged, in this order; empty for frames that were not planned.
        together: Whether those groups move at once.
        sample_times: When the motion was looked at, from its start [s], (K,).
        samples: Where all actuated joints were then [rad], (K, J).
        resumed: Where the motion before it was taken up again [s]; None for one from its beginning.
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
    """A line of the program's log at `time` [s], `level` as in `logging`."""

    time: float
    level: int
    logger: str
    message: str


@dataclass(frozen=True, slots=True)
class Attachment:
    """A named file, such as the task's YAML; dated as the record before it."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Note:
    """Named facts, such as the versions of libraries."""

    name: str
    facts: Mapping[str, str]


# What `Recording.records` yields; the robot's description is an attachment.
RunRecord = (
    Sent | Received | Transition | Goal | Feedback | Result | NodeStatus | Plan | Schedule | LogLine
)
Record = Description | RunRecord
Item = Record | Attachment | Note
