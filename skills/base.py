"""The base class of skills: a py_trees leaf with typed ports and hooks to start and halt it."""

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

# Deprecated names of members, and the names that replace them. Users' skills may still have them.
_RENAMED = {
    "judge": "validate",
    "judges_parts": "validates_partial",
    "shortest": "min_duration",
    "doing": "phase",
}


class WorldChange(Enum):
    """What a skill does to the body that its input port `body` names."""

    ADDS = "adds the body that the method `body` returns"
    ATTACHES = "attaches it to the link of the input port `link`; without that port, detaches it"
    REMOVES = "removes it"


class Skill(BehaviourWithPorts):
    """A leaf of the tree. A subclass declares its ports, and implements `on_start` and other hooks.

    Args:
        name: Name of the node in the tree.
        context: Robot, arm, planners and time source of the skill.

    Attributes:
        moves: True if the skill moves the arm. Only one such skill may run at a time.
        condition: True if the skill only checks something, and finishes in the tick of its start.
        pure: True if the result depends only on the inputs.
        validates_partial: True if `validate` also receives partially known inputs: Positions with
            `unknown` joints, and lists with None for an unknown item.
        phase: Reported phase while the skill runs, such as `waiting`. Default: `planning` until a
            motion is scheduled, then `executing`.
        may_fail: False if the skill always succeeds.
        may_succeed: False if the skill always fails.
        world_change: Change to the world by the skill; None for no change.
        pose_output: Output port for the configuration that `poses` returns.
        tool_output: Output port for the joint positions that answer `tool_query`; empty if the
            skill has no such port.
        plans_goal: True if the skill plans a motion to the configuration at its input port `goal`.
        group: Group of joints for which the skill plans; empty if it plans no motion.
        copies_targets: True if the configuration that the skill writes consists of its inputs.
        failure: Error of the last failure; None if the skill has not failed since its start.
        broken: Last unexpected exception of the skill's code (not an error of armtree), or None.
        start_count: Number of starts.
        named_ports: Input ports whose value in the task is a key or a parameter.
        values_read: Values that the skill has read from `named_ports` since its start, as texts for
            people, by port.
        synonyms: Names of the skill in other languages and libraries, for suggestions.
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

        Args:
            port_name: Name of the port.
            default: Value to return if the port has no value.

        Raises:
            KeyError: The skill has no such port.
            TypeError: The value does not have the type of the port.
            NoDataAvailable: The port has no value and no default.
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
            inputs: Known values of input ports, by port: values in the task, and defaults.

        Raises:
            SkillError: An input is invalid. Set the location of the value with `SkillError.at`, so
                that messages show its line in the file.
            ExceptionGroup: Several inputs are invalid. Each error is reported with its own line.
        """

    @classmethod
    def mistyped(cls, inputs: Mapping[str, Any], types: Mapping[str, str]) -> str:
        """Return an error as a text if the types of the inputs do not match each other, else "".

        Args:
            inputs: Values that are written in the task, by port.
            types: Types of all inputs, by port, as named in task files.
        """
        return ""

    @classmethod
    def min_duration(cls, inputs: Mapping[str, Any]) -> float:
        """Return a lower bound of the skill's duration [s], computed from the known inputs."""
        return 0.0

    @classmethod
    def poses(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the configurations to which the skill moves the arm, if its inputs are known.

        Each configuration has one value per actuated joint [rad]. Before the run, armtree checks
        these configurations for collision.
        """
        return []

    @classmethod
    def waypoints(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the via points that the arm passes before the goal.

        Each point has one value per actuated joint of the skill's group [rad].
        """
        return []

    @classmethod
    def tool_query(cls, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """Return the query for joint positions that bring the tool to its target.

        The query has an empty world. The result is None if an input is not known.
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
        """Progress of the motion, from 0 to 1; None if it is not known."""
        return None

    @property
    def time_left(self) -> float:
        """Time until the motion of the skill ends [s]; 0 if it is not known."""
        return 0.0

    def on_start(self) -> Status:
        """Start the work of the skill. Called at the first tick. Must not block."""
        raise NotImplementedError

    def on_running(self) -> Status:
        """Continue the work. Called at each tick while the skill is RUNNING. Must not block."""
        return Status.RUNNING

    def on_halt(self) -> None:
        """Stop the work. Called once if the skill is interrupted. Must neither block nor raise."""

    def on_pause(self) -> None:
        """Pause until the next tick, which may be much later. Must neither block nor raise.

        Work in other processes, such as planning, may continue.
        """

    def update(self) -> Status:
        """Run one tick, and return the new status.

        An error of armtree is not raised. It is stored in `failure`, and the status is FAILURE.
        """
        if not (self._live or self.condition) and self.context.at_breakpoint(self):
            self.feedback_message = "waits to begin"
            return Status.RUNNING
        starts, self._live = not self._live, True
        if starts:
            self.start_count += 1
            self.failure, self.feedback_message, self.values_read = None, "", {}
        try:
            status = self.on_start() if starts else self.on_running()
        except BaseException as error:  # also SystemExit, which would end the executor thread
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
        """Read the property `busy`, `progress` or `time_left`, or call `on_pause`.

        Args:
            hook: Name of the property or method.

        Returns:
            The value of the property, or the result of the call.

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
        """Store an exception of the skill's code, and stop the arm, because its state is unknown.

        Args:
            hook: Name of the method that raised the exception.
            raised: The exception.

        Returns:
            The error that reports the exception.
        """
        error = SkillBroken(f"{type(self).__name__}.{hook}", raised)
        self.broken = error
        logger.error("%s", error)
        logger.debug("it was raised here", exc_info=raised)
        self.failure = self.failure or error
        self.feedback_message = str(self.failure)
        self.context.arm.stop()
        return error


def _accept_old_names(kind: type[Skill]) -> None:
    """Let a class of skills use the deprecated names in `_RENAMED`.

    A member with a deprecated name also gets the new name, with a warning. A member with a new name
    also gets the deprecated name, so that `super().judge` in users' skills works.
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
