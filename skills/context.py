"""The context of a skill: robot, arm, planners, time source, and a callback for events."""

import dataclasses
from collections.abc import Callable
from dataclasses import field

from py_trees.behaviour import Behaviour

from hardware import Arm, Clock, Robot, Schedule
from hardware.loading.dataclass import dataclass

from .leader import Leader, NullLeader
from .merged_motion import MergedMotion
from .motion.errors import MotionError
from .motion.query import Query
from .motion.trajectory.plan import Plan
from .motion.workers.pool import Pool
from .motion.world import EMPTY, World
from .question import NoOperator, Operator


@dataclass(frozen=True, slots=True)
class Planned:
    """Event: a planner has answered a query.

    Attributes:
        query: The planning query.
        answer: The plan, or the error if no motion was found.
    """

    query: Query
    answer: Plan | MotionError


@dataclass(frozen=True, slots=True)
class Scheduled:
    """Event: a motion was compiled into frames.

    Attributes:
        schedule: Schedule of the frames.
        start: Commanded positions of the arm before the first frame, one value per actuated joint
            [rad].
        motion: Motion that was compiled; None for frames that were not planned.
        resumed: Time in the interrupted motion from which the frames continue it [s]; None if the
            frames start a motion at its beginning.
    """

    schedule: Schedule
    start: tuple[float, ...]
    motion: MergedMotion | None
    resumed: float | None = None


@dataclass(frozen=True, slots=True)
class LeaderRead:
    """Event: the positions of the leader were read, for the next step of the arm that follows.

    Attributes:
        positions: Measured positions of the leader, one value per actuated joint [rad].
    """

    positions: tuple[float, ...]


SkillEvent = Planned | Scheduled | LeaderRead


@dataclasses.dataclass(slots=True)
class Scene:
    """The world around the arm during a run.

    Attributes:
        world: The current world. Skills replace it, on the thread that ticks the tree.
    """

    world: World = EMPTY


@dataclass(frozen=True, slots=True)
class Context:
    """The context of a skill: everything that it needs from its run.

    Attributes:
        robot: Description of the robot.
        arm: The arm.
        pool: Pool of planners.
        seed: Seed for planners and other random draws.
        timeout: Longest time a planner may take [s].
        wake: Callback that requests a tick of the tree. Any thread may call it.
        publish: Callback that reports an event to the recorder.
        clock: Time source.
        wake_at: Callback that requests a tick at a time [s] on the clock of `now()`. Only the
            earliest request is kept, so repeat a request at every tick.
        scene: Holds the world around the arm.
        operator: Interface to the person who answers questions.
        leader: Interface to the arm that a person moves by hand.
        paused_time: Callback that returns the total time of pauses so far [s].
        at_breakpoint: Callback that returns True if a skill must not start yet.
    """

    robot: Robot
    arm: Arm
    pool: Pool
    seed: int
    timeout: float
    wake: Callable[[], None]
    publish: Callable[[SkillEvent], None]
    clock: Clock
    wake_at: Callable[[float], None]
    scene: Scene = field(default_factory=Scene)
    operator: Operator = field(default_factory=NoOperator)
    leader: Leader = field(default_factory=NullLeader)
    paused_time: Callable[[], float] = field(default=lambda: 0.0)
    at_breakpoint: Callable[[Behaviour], bool] = field(default=lambda _: False)

    def now(self) -> float:
        """Return the current time of the run [s]. This time stands still during a pause."""
        return self.clock.now() - self.paused_time()
