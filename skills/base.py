"""The base class of skills: a py_trees leaf with typed ports that can be started and halted."""

import logging
import sys
import warnings
from collections.abc import Collection, Mapping
from enum import Enum
from typing import Any, ClassVar

from py_trees.common import Status
from py_trees.ports import BehaviourWithPorts

from hardware import HardwareError, Robot

from .context import Context
from .errors import SkillBroken, SkillError, combine_errors, known_errors
from .motion.errors import MotionError
from .motion.query import ToolQuery
from .motion.world import Body
from .ports import value_words

logger = logging.getLogger(__name__)

# Names that skills of users may still have, and the names that replace them.
_RENAMED = {
    "judge": "validate",
    "judges_parts": "validates_partial",
    "shortest": "min_duration",
    "doing": "phase",
}


class WorldChange(Enum):
    """Change to the world by a skill, for the body that its input port `body` names."""

    ADDS = "adds the body that the method `body` returns"
    ATTACHES = "attaches it to the link of the input port `link`; without that port, detaches it"
    REMOVES = "removes it"


class Skill(BehaviourWithPorts):
    """A leaf of the tree. A subclass declares its ports, and implements `on_start` and other hooks.

    Args:
        name: Name of the node in the tree.
        context: Robot, arm, planners and time source of the skill.

    Attributes:
        moves: True if it moves the arm. Only one such skill may run at a time.
        condition: True if it only checks something, and finishes in the tick in which it starts.
        pure: True if its result depends only on its inputs.
        validates_partial: True if `validate` also receives partially known inputs: Positions with
            `unknown` joints, and lists with None for an unknown item.
        phase: Reported phase while the skill runs, such as `waiting`. Default: `planning` until a
            motion is scheduled, then `executing`.
        may_fail: False if it always succeeds.
        may_succeed: False if it always fails.
        world_change: Its change to the world; None for no change.
        pose_output: Output port for the configuration that `poses` returns.
        tool_output: Output port for the joint positions that answer `tool_query`; empty if it has
            none.
        plans_goal: True if it plans a motion to the configuration at its input port `goal`.
        group: Group of joints that it plans for; empty if it does not plan a motion.
        copies_targets: True if the configuration that it writes consists of its inputs.
        failure: Error of the last failure, or None.
        broken: Last exception of its code other than an error of armtree, or None.
        start_count: Number of starts.
        named_ports: Input ports with a key or a parameter in the task's files.
        values_read: Values for people, by port: those that it has read from `named_ports` since its
            start.
        synonyms: Names of the skill in other languages and libraries, for corrections.
    """

    moves = False
    condition = False
    pure = False
    validates_partial = False
    phase = ""
    may_fail = True
    may_succeed = True
    world_change: WorldChange | None = None
    pose_output = "goal"
    tool_output = ""
    plans_goal = False
    group = ""
    copies_targets = False
    synonyms: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """Register the class as a skill. A class without ports gets an empty list of ports."""
        _accept_old_names(cls)
        if cls.on_start is not Skill.on_start:
            for ports in ("INPUT_PORTS", "OUTPUT_PORTS"):
                if not hasattr(cls, ports):
                    setattr(cls, ports, {})
        super().__init_subclass__(**options)

    def __init__(self, name: str, context: Context) -> None:
        super().__init__(name)
        self.context = context
        self.failure: SkillError | MotionError | HardwareError | None = None
        self.broken: SkillBroken | None = None
        self._live = False
        self.start_count = 0
        self.named_ports: Collection[str] = ()
        self.values_read: dict[str, str] = {}

    def get_input(self, port_name: str, default: Any = None) -> Any:
        """Return the value of an input port.

        Raises:
            KeyError: The skill has no such port.
            TypeError: The value does not have the type of the port.
            NoDataAvailable: There is no value, and no default.
        """
        value = super().get_input(port_name, default)
        if port_name in self.named_ports:
            unit = getattr(self.input_ports()[port_name], "unit", "")
            self.values_read[port_name] = value_words(value, unit, self.context.robot)
        return value

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the inputs that are known before the arm moves.

        Args:
            robot: Description of the robot.
            inputs: Known values of input ports: values in the task, and defaults.

        Raises:
            SkillError: An input is invalid. `SkillError.at` names the value, so that messages show
                its line.
            ExceptionGroup: Several inputs are invalid. Each error is reported at its own line.
        """

    @classmethod
    def mistyped(cls, inputs: Mapping[str, Any], types: Mapping[str, str]) -> str:
        """Return an error if the types of the inputs do not match each other, else "".

        Args:
            inputs: Values written in the task, by port.
            types: Their types, by port, as named in task files.
        """
        return ""

    @classmethod
    def min_duration(cls, inputs: Mapping[str, Any]) -> float:
        """Return a lower bound of the skill's duration [s], from the inputs in the task."""
        return 0.0

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the configurations to which the known inputs move the arm.

        Each has one value per actuated joint [rad]. The analysis checks them for collision before
        the run.
        """
        return []

    @classmethod
    def waypoints(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the points that the arm passes on its way to the goal.

        Each has one value per actuated joint of the arm's group [rad].
        """
        return []

    @classmethod
    def tool_query(cls, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """Return the query for the target of the tool, in an empty world.

        The result is None if an input is not known.
        """
        return None

    @classmethod
    def body(cls, inputs: Mapping[str, Any]) -> Body | None:
        """Return the body that the inputs add to the world, or None if an input is not known.

        armtree loads and checks the body before the run.
        """
        return None

    @property
    def busy(self) -> bool:
        """True while work that the skill started continues, even after a halt."""
        return False

    @property
    def progress(self) -> float | None:
        """Progress of the motion from 0 to 1; None if the skill does not measure it."""
        return None

    @property
    def time_left(self) -> float:
        """Time until its motion ends [s]; 0 if this is not known."""
        return 0.0

    def on_start(self) -> Status:
        """Start the work. Called at the first tick. Must not block."""
        raise NotImplementedError

    def on_running(self) -> Status:
        """Continue the work. Called at each tick after the status RUNNING. Must not block."""
        return Status.RUNNING

    def on_halt(self) -> None:
        """Stop the work. Called once if the skill is interrupted. Must neither block nor raise."""

    def on_pause(self) -> None:
        """Pause until the next tick, which may be much later. Must neither block nor raise.

        Work in other processes, such as planning, may continue.
        """

    def update(self) -> Status:
        """Run one tick. An error of armtree becomes FAILURE, and `failure` keeps it."""
        if not (self._live or self.condition) and self.context.at_breakpoint(self):
            self.feedback_message = "waits to begin"
            return Status.RUNNING
        starts, self._live = not self._live, True
        if starts:
            self.start_count += 1
            self.failure, self.feedback_message, self.values_read = None, "", {}
        try:
            status = self.on_start() if starts else self.on_running()
        except BaseException as error:  # also SystemExit, which would end the thread that ticks
            status = Status.FAILURE
            if errors := known_errors(error):
                self.failure = combine_errors(errors)
                self.feedback_message = str(self.failure)
            else:
                self._break("on_start" if starts else "on_running", error)
                if not starts:
                    self._halt()
        self._live = status is Status.RUNNING
        return status

    def call_hook(self, hook: str) -> Any:
        """Return the value of `busy`, `progress` or `time_left`, or call `on_pause`.

        Raises:
            SkillBroken: The hook raised an exception. The arm is stopped.
        """
        try:
            value = getattr(self, hook)
            return value() if callable(value) else value
        except BaseException as error:
            raise self._break(hook, error) from error

    def terminate(self, new_status: Status) -> None:
        """Halt the skill if it is running. py_trees calls this for finished leaves too."""
        if self._live:
            self._live = False
            self._halt()

    def _halt(self) -> None:
        try:
            self.on_halt()
        except BaseException as error:
            self._break("on_halt", error)

    def _break(self, hook: str, raised: BaseException) -> SkillBroken:
        """Keep an exception of the skill's code, and stop the arm: its state is unknown."""
        error = SkillBroken(f"{type(self).__name__}.{hook}", raised)
        self.broken = error
        logger.error("%s", error)
        logger.debug("it was raised here", exc_info=raised)
        self.failure = self.failure or error
        self.feedback_message = str(self.failure)
        self.context.arm.stop()
        return error


def _accept_old_names(kind: type[Skill]) -> None:
    """Give members with an old name the new name, with a warning.

    Members with a new name also get the old name, so that `super().judge` in users' skills works.
    """
    members = dict(vars(kind))
    for old, new in _RENAMED.items():
        if new in members:
            setattr(kind, old, members[new])
        elif old in members:
            file = getattr(sys.modules.get(kind.__module__), "__file__", None) or kind.__module__
            message = f"{file}: {kind.__name__}.{old} is deprecated; rename it to {new}"
            warnings.warn(message, DeprecationWarning, stacklevel=3)
            setattr(kind, new, members[old])


_accept_old_names(Skill)
