"""What every skill is: a py_trees leaf with typed ports that can be started and halted."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from py_trees.common import Status
from py_trees.ports import BehaviourWithPorts

from hardware import Arm, Clock, HardwareError, Robot, Schedule

from .causes import as_one, causes_of
from .errors import SkillBroken, SkillError
from .merged import Merged
from .motion.errors import MotionError
from .motion.plan import Plan
from .motion.query import Query
from .motion.workers.pool import Pool
from .motion.world import EMPTY, Body, World
from .operator import NoOperator, Operator

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Planned:
    """A planner answered.

    Attributes:
        query: What was asked.
        answer: The plan, or why there is none.
    """

    query: Query
    answer: Plan | MotionError


@dataclass(frozen=True, slots=True)
class Scheduled:
    """A motion was turned into frames.

    Attributes:
        schedule: The frames.
        start: Where the arm stood, one value per actuated joint [rad].
        motion: What the frames were made of; None for frames that were not planned.
        resumed: Where the motion before it was taken up again [s]; None for one from its beginning.
    """

    schedule: Schedule
    start: tuple[float, ...]
    motion: Merged | None
    resumed: float | None = None


SkillEvent = Planned | Scheduled


@dataclass(slots=True)
class Scene:
    """What is around the arm now.

    Attributes:
        world: Its bodies; replaced by skills, on the thread that ticks.
    """

    world: World = EMPTY


def _never_paused() -> float:
    return 0.0


def _holds_nothing(skill: "Skill") -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Context:
    """What a skill works with.

    Attributes:
        robot: The robot.
        arm: Its arm.
        pool: The planners.
        seed: For whatever draws at random.
        timeout: How long a planner may take [s].
        wake: Asks for a tick; may be called from any thread.
        tell: Hands an event to whoever records.
        clock: Whose time.
        wake_at: Asks for a tick at a time by `now` [s]; only within a tick, and anew at each.
        scene: What stands around the arm, and what it holds.
        operator: Who answers questions.
        paused: For how long the run was paused so far [s].
        holds: Whether a skill is kept from beginning, so that its run can be looked at.
    """

    robot: Robot
    arm: Arm
    pool: Pool
    seed: int
    timeout: float
    wake: Callable[[], None]
    tell: Callable[[SkillEvent], None]
    clock: Clock
    wake_at: Callable[[float], None]
    scene: Scene = field(default_factory=Scene)
    operator: Operator = field(default_factory=NoOperator)
    paused: Callable[[], float] = _never_paused
    holds: Callable[["Skill"], bool] = _holds_nothing

    def now(self) -> float:
        """Time as the run has it, which stands still while it is paused [s]."""
        return self.clock.now() - self.paused()


class Skill(BehaviourWithPorts):
    """A leaf. Subclasses name their ports and implement `on_start`, and what else they need.

    Args:
        name: Shown in the tree.
        context: What it works with.

    Attributes:
        moves: Whether it moves the arm, which only one skill may do at a time.
        condition: Whether it only asks, and ends in the tick in which it begins.
        pure: Whether its answer follows from its inputs alone.
        judges_parts: Whether `judge` is also handed inputs of which only a part is known: Positions
            with `unknown` joints, and None for an item of a list.
        doing: What is going on while it is at work, such as `waiting`; empty for what it does for
            motions: `planning` until one is scheduled, then `executing`.
        may_fail: Whether it can fail.
        may_succeed: Whether it can succeed.
        failure: Why it failed last, if it did.
        broken: What its code raised last that it must not.
        begun: How often it began.
    """

    moves = False
    condition = False
    pure = False
    judges_parts = False
    doing = ""
    may_fail = True
    may_succeed = True

    def __init_subclass__(cls, **more: Any) -> None:
        """Take a class that begins something for a skill, though it names no ports."""
        if cls.on_start is not Skill.on_start:
            for ports in ("INPUT_PORTS", "OUTPUT_PORTS"):
                if not hasattr(cls, ports):
                    setattr(cls, ports, {})
        super().__init_subclass__(**more)

    def __init__(self, name: str, context: Context) -> None:
        super().__init__(name)
        self.context = context
        self.failure: SkillError | MotionError | HardwareError | None = None
        self.broken: SkillBroken | None = None
        self._live = False
        self.begun = 0

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Refuse what is wrong already by the inputs written in the task, before the arm moves.

        Args:
            robot: The robot.
            inputs: Values of the input ports that are known by then: those that the task spells
                out, and defaults.

        Raises:
            SkillError: What is wrong; `at` says which value, so that its line is shown.
            ExceptionGroup: Several of these, which are told each at its own line.
        """

    @classmethod
    def mistyped(cls, inputs: Mapping[str, Any], types: Mapping[str, str]) -> str:
        """Why the types of its inputs do not go together; empty where they do.

        Args:
            inputs: Values that the task spells out, by port.
            types: As the task file calls them, by port.
        """
        return ""

    @classmethod
    def shortest(cls, inputs: Mapping[str, Any]) -> float:
        """How long it takes at least [s], by the inputs written in the task."""
        return 0.0

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Where the inputs that are known send the arm: values of the actuated joints [rad].

        Only whole configurations count; they are what can be checked for collision beforehand.
        """
        return []

    @classmethod
    def body(cls, inputs: Mapping[str, Any]) -> Body | None:
        """What the inputs written in the task put into the world; None where not all is written.

        It is what can be loaded beforehand.
        """
        return None

    @property
    def busy(self) -> bool:
        """Whether work that it began goes on, even after a halt."""
        return False

    @property
    def progress(self) -> float | None:
        """How far the motion is, 0 to 1; None where there is nothing to measure."""
        return None

    def on_start(self) -> Status:
        """Begin; never blocks. Called at the first tick."""
        raise NotImplementedError

    def on_running(self) -> Status:
        """Look again, after a tick that left it running."""
        return Status.RUNNING

    def on_halt(self) -> None:
        """Stop; called once when interrupted while running, and must neither block nor raise."""

    def on_pause(self) -> None:
        """Stand still until the next tick, which may be long after; must neither block nor raise.

        What goes on elsewhere, such as planning, may go on.
        """

    def update(self) -> Status:
        """One tick; an error of ours becomes FAILURE and keeps its cause."""
        if not (self._live or self.condition) and self.context.holds(self):
            self.feedback_message = "waits to begin"
            return Status.RUNNING
        begin, self._live = not self._live, True
        if begin:
            self.begun += 1
            self.failure, self.feedback_message = None, ""
        try:
            status = self.on_start() if begin else self.on_running()
        except BaseException as error:  # SystemExit, too, would end the thread that ticks
            status = Status.FAILURE
            if causes := causes_of(error):
                self.failure = as_one(causes)
                self.feedback_message = str(self.failure)
            else:
                self._broke("on_start" if begin else "on_running", error)
                if not begin:
                    self._halt()
        self._live = status is Status.RUNNING
        return status

    def look(self, what: str) -> Any:
        """What `busy` or `progress` says, or `on_pause` does.

        Raises:
            SkillBroken: It raises what it must not; the arm is stopped.
        """
        try:
            found = getattr(self, what)
            return found() if callable(found) else found
        except BaseException as error:
            raise self._broke(what, error) from error

    def terminate(self, new_status: Status) -> None:
        """Halt if it was running; py_trees calls this for finished leaves too."""
        if self._live:
            self._live = False
            self._halt()

    def _halt(self) -> None:
        try:
            self.on_halt()
        except BaseException as error:
            self._broke("on_halt", error)

    def _broke(self, what: str, raised: BaseException) -> SkillBroken:
        """Note what the code of the skill raised; nobody knows what it leaves, so the arm stops."""
        error = SkillBroken(f"{type(self).__name__}.{what}", raised)
        self.broken = error
        logger.error("%s", error)
        logger.debug("it was raised here", exc_info=raised)
        self.failure = self.failure or error
        self.feedback_message = str(self.failure)
        self.context.arm.stop()
        return error
