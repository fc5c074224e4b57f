"""Calls of the hooks of skills before a run. An error in a hook affects only its node."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import partial
from math import inf, isfinite
from numbers import Real
from typing import Any, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy

from hardware import Robot
from hardware.loading.dataclass import dataclass
from hardware.spelling import did_you_mean, suggested
from skills import (
    BadTarget,
    Context,
    OutOfBounds,
    Positions,
    Skill,
    SkillBroken,
    SkillError,
    known_errors,
)
from skills.motion import Body, MotionError, ToolQuery, shown
from trees.errors import Correction, Mistake, Place
from trees.reading.document import Located, nested
from trees.reading.lines import left_out
from trees.reading.literals import (
    in_other_unit,
    in_radians,
    in_smaller_units,
    near_limit,
    renamed,
)

from .leaf import Leaf
from .port_types import declaration
from .values_by_port import with_more

Fault = SkillError | MotionError
Pose = tuple[float, ...]
_Answer = TypeVar("_Answer")
_SHOWN = 5  # largest number of poses in a message


@dataclass(frozen=True, slots=True)
class RefusedInput:
    """An input that a skill refuses, or an exception that its code raises.

    Attributes:
        node: Node of the skill.
        kind: Name of the skill.
        error: The error of the skill.
        place: Place of the value, or of the skill.
        instead: The corrected lines; None if unknown.
        value: The value; None if unknown.
    """

    node: Behaviour
    kind: str
    error: Fault
    place: Place
    instead: Correction | None = None
    value: Located | None = None

    @property
    def mistake(self) -> Mistake:
        """The refusal as a mistake in a file."""
        inside = port_of_subtree(self.place, self.kind)
        words = str(self.error) if inside else f"{self.kind}: {self.error}"
        return Mistake(self.place, words, self.instead)


def port_of_subtree(place: Place, skill: str) -> str:
    """Return the port of the subtree at which a value is written; empty if it is at the skill.

    A skill inside a subtree has no name in messages, because the user did not write it.
    """
    _, subtree, within = f"{place.location}.".rpartition(".with.")
    return re.split(r"[.[]", within)[0] if subtree and f".{skill}." not in within else ""


def named_port(place: Place, skill: str, port: str) -> str:
    """Return the name of the port that has a value, for messages."""
    return port_of_subtree(place, skill) or f"{skill}.{port}"


class SkillHooks:
    """Calls the hooks of the skills of one tree, and checks their results.

    Args:
        doubtful: Nodes that are wrong from the start.

    Attributes:
        doubtful: Nodes that are known to be wrong. Their effects are unknown.
        saved: Joint positions [rad] by joint name, by name of the pose. Messages suggest the poses.
    """

    def __init__(self, doubtful: Iterable[Behaviour] = ()) -> None:
        self.doubtful = set(doubtful)
        self.saved: Mapping[str, Mapping[str, float]] = {}
        self._refused: dict[tuple[Place, str], RefusedInput] = {}

    @property
    def mistakes(self) -> list[Mistake]:
        """All refusals as mistakes in files."""
        return [refusal.mistake for refusal in self.refused]

    @property
    def refused(self) -> list[RefusedInput]:
        """All refusals, without duplicates."""
        return list(self._refused.values())

    def make(self, kind: type[Skill], name: str, context: Context, place: Place) -> Behaviour:
        """Return a new skill, or a placeholder if the constructor of the skill fails."""
        made, faults = _result(kind, "__init__", lambda: kind(name, context), _MADE)
        if made is not None:
            return made
        node = Dummy(name)
        for fault in faults:
            self._refuse(RefusedInput(node, kind.__name__, fault, place))
        return node

    def validate(self, leaf: Leaf, robot: Robot) -> None:
        """Let a skill validate its inputs, and record the refused ones with corrections."""
        kind = type(leaf.skill)
        inputs = {**leaf.known, **leaf.partial} if kind.validates_partial else leaf.known
        _, faults = _result(kind, "validate", lambda: kind.validate(robot, inputs), _ANY)
        for fault in faults:
            (place, value), instead = _refused(leaf, fault), None
            if value and isinstance(fault, OutOfBounds | BadTarget):
                instead = _nearest(leaf, robot, inputs, fault)
            if value and (name := suggested(str(fault))):
                step = fault.location[-1] if isinstance(fault, SkillError) else ""
                is_key = place == value.label
                there = renamed(str(step), name, value)[1] if is_key else None
                instead = there or place.replaced(str(value.value), name)
            if value and isinstance(fault, BadTarget) and fault.location:
                instead = self._other_pose(leaf, robot, inputs, fault, value) or instead
                if len(faults) == 1:
                    instead = _completed(robot, value, str(fault.location[-1])) or instead
            if value and isinstance(fault, BadTarget) and fault.superfluous:
                instead = left_out(place)
            if value and (units := _in_smaller_unit(leaf, robot, inputs, fault)):
                unit, near = units
                right = _with_unit(value, near)
                words = str(fault).removesuffix(did_you_mean(right))
                # The exception may be raised again.
                fault.args = (in_other_unit(words, value, unit, right),)
                instead = value.instead(right)
            self._refuse(RefusedInput(leaf.skill, kind.__name__, fault, place, instead, value))

    def _other_pose(
        self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any], fault: BadTarget, value: Located
    ) -> Correction | None:
        """Return the line with a pose that the skill accepts. Name all such poses in `fault`."""
        port = str(fault.location[0])
        if not isinstance(leaf.written[port].value, str) or not isinstance(value.value, str):
            return None
        fitting = [
            name
            for name, pose in self.saved.items()
            if _accepts(leaf, robot, {**inputs, port: Positions(pose)}, (port,))
        ]
        if fitting:
            are = "pose that fits is" if len(fitting) == 1 else "poses that fit are"
            # The exception may be raised again.
            words = str(fault).partition("; saved ")[0]
            fault.args = (f"{words}; saved {are} {', '.join(fitting[:_SHOWN])}",)
        return value.instead(fitting[0]) if fitting else None

    def min_duration(self, leaf: Leaf) -> float:
        """Return a lower bound of the time of a skill [s]."""
        return self._call(leaf, "min_duration", _DURATION, leaf.known) or 0.0

    def poses(self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any]) -> list[Pose]:
        """Return the configurations to which a skill moves [rad]; empty if the skill is wrong."""
        wanted = _list_of_poses(len(robot.actuated))
        return self._call_sound(leaf, "poses", wanted, robot, inputs) or []

    def waypoints(self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any]) -> list[Pose]:
        """Return the waypoints before the goal: positions of the joints of group `arm` [rad]."""
        wanted = _list_of_poses(len(robot.actuated_in("arm")))
        return self._call_sound(leaf, "waypoints", wanted, robot, inputs) or []

    def tool_query(self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """Return the query for the target of the tool, or None if it is missing or invalid."""
        query: ToolQuery | None = self._call_sound(leaf, "tool_query", _TOOL_QUERY, robot, inputs)
        return query

    def body(self, leaf: Leaf) -> Body | None:
        """Return the body that a skill adds to the world, or None if it is missing or invalid."""
        body: Body | None = self._call_sound(leaf, "body", _BODY, leaf.known)
        return body

    def _call_sound(self, leaf: Leaf, hook: str, wanted: "_Wanted", *arguments: object) -> Any:
        """Call a hook. Return None if the hook fails, or if the node is wrong."""
        return None if leaf.skill in self.doubtful else self._call(leaf, hook, wanted, *arguments)

    def _call(self, leaf: Leaf, hook: str, wanted: "_Wanted", *arguments: object) -> Any:
        """Call a hook. Return None if the hook fails."""
        kind = type(leaf.skill)
        answer, faults = _result(kind, hook, lambda: getattr(kind, hook)(*arguments), wanted)
        for fault in faults:
            self._refuse(RefusedInput(leaf.skill, kind.__name__, fault, _refused(leaf, fault)[0]))
        return answer

    def _refuse(self, refusal: RefusedInput) -> None:
        self.doubtful.add(refusal.node)
        self._refused.setdefault((refusal.place, str(refusal.error)), refusal)


@dataclass(frozen=True, slots=True)
class _Wanted:
    """The values that a hook may return.

    Attributes:
        words: Description for messages.
        fits: Callback that returns True for an allowed value.
    """

    words: str
    fits: Callable[[Any], bool]


def _result(
    kind: type[Skill], what: str, call: Callable[[], _Answer], wanted: _Wanted
) -> tuple[_Answer | None, Sequence[Fault]]:
    """Call a hook. Return its result and no causes, or None and the causes of its failure."""
    where = f"{kind.__name__}.{what}"
    try:
        answer = call()
        if wanted.fits(answer):
            return answer, ()
        return None, [SkillBroken(where, f"gave {shown(answer)}, not {wanted.words}")]
    except (Exception, SystemExit) as error:
        causes = known_errors(error)
        own = [cause for cause in causes if isinstance(cause, SkillError | MotionError)]
        if own and len(own) == len(causes):
            return None, own
        return None, [SkillBroken(where, error)]


def _list_of_poses(joints: int) -> _Wanted:
    """Return the check for lists of configurations with this number of joints."""

    def fits(poses: object) -> bool:
        return isinstance(poses, list) and all(map(is_pose, poses))

    def is_pose(pose: Any) -> bool:
        numbers = isinstance(pose, tuple) and len(pose) == joints
        return numbers and all(map(_is_finite, pose))

    return _Wanted(f"a list of tuples of {joints} numbers", fits)


def _is_finite(number: Any) -> bool:
    """Return True if a value is a finite number within the range of floats."""
    try:
        return isinstance(number, Real) and isfinite(number)
    except OverflowError:
        return False


def _is_duration(least: Any) -> bool:
    return _is_finite(least) or (isinstance(least, Real) and least == inf)


def _is_made(made: object) -> bool:
    return isinstance(made, Skill) and {"id", "context"} <= vars(made).keys()


_ANY = _Wanted("anything", lambda _: True)
_MADE = _Wanted("a skill that called super().__init__(name, context)", _is_made)
_DURATION = _Wanted("a number", _is_duration)
_TOOL_QUERY = _Wanted(
    "a ToolQuery or None", lambda query: query is None or isinstance(query, ToolQuery)
)
_BODY = _Wanted("a Body or None", lambda body: body is None or isinstance(body, Body))


def _refused(leaf: Leaf, error: Fault) -> tuple[Place, Located | None]:
    """Return the place and value that a skill refuses, or the place of the skill and None."""
    port, *within = error.location if isinstance(error, SkillError) and error.location else ("",)
    value = leaf.written.get(str(port))
    if value is None:
        return leaf.place, None
    place = value.place
    for step in within:
        if isinstance(value.value, dict) and step in value.value:
            value = value.value[str(step)]
            place = value.label
        elif isinstance(value.value, list) and isinstance(step, int):
            value = value.value[step]
            place = value.place
    return place, value


def _nearest(
    leaf: Leaf, robot: Robot, inputs: Mapping[str, Any], fault: OutOfBounds | BadTarget
) -> Correction | None:
    """Return the line with the nearest position within the limits, or with a known joint.

    If an angle has no unit, add the angle and its limit in radians to the message of `fault`.
    """
    port, joint = (*map(str, fault.location), "", "")[:2]
    (place, value), given = _refused(leaf, fault), inputs.get(port)
    if value is None or not isinstance(given, Positions) or joint not in given:
        return None
    known = {each.name for each in robot.joints}
    if joint not in known:
        if len(given.keys() - known) > 1:
            return None
        for each in robot.actuated:
            pairs = ((each.name if name == joint else name, q) for name, q in given.items())
            now, at = {**inputs, port: Positions(pairs)}, (port, each.name)
            if each.name not in given and _accepts(leaf, robot, now, at):
                return place.replaced(joint, each.name)
    elif isinstance(fault, OutOfBounds) and fault.limit is not None:
        unit = robot.joint(joint).unit
        for text, position in near_limit(value, fault.limit, unit):
            now = {**inputs, port: Positions({**given, joint: position})}
            if _accepts(leaf, robot, now, fault.location):
                if not [*in_smaller_units(value.value, unit)]:
                    words = in_radians(str(fault), value, unit, fault.limit, text)
                    fault.args = (words,)  # the exception may be raised again
                return value.instead(text)
    return None


def _completed(robot: Robot, value: Located, joint: str) -> Correction | None:
    """Return the lines of joint values with the boot positions of the missing joints added."""
    given, group = nested(value), next((g for g in robot.groups if joint in robot.groups[g]), "")
    if not given or not group or joint in given:
        return None
    missing = [each for each in robot.actuated_in(group) if each.name not in given]
    return with_more(value.place, given, {each.name: f"{each.boot:g}" for each in missing})


def _accepts(
    leaf: Leaf, robot: Robot, inputs: Mapping[str, Any], location: tuple[str | int, ...]
) -> bool:
    """Return True if a skill accepts the input at a location. The location () is all inputs."""
    kind, within = type(leaf.skill), len(location)
    _, faults = _result(kind, "validate", partial(kind.validate, robot, inputs), _ANY)
    broken = any(isinstance(fault, SkillBroken) for fault in faults)
    return not broken and all(getattr(f, "location", ())[:within] != location for f in faults)


def _in_smaller_unit(
    leaf: Leaf, robot: Robot, inputs: Mapping[str, Any], error: Fault
) -> tuple[str, str] | None:
    """Return the unit of a refused number, and a smaller unit in which the number is valid."""
    kind, (_, value) = type(leaf.skill), _refused(leaf, error)
    if value is None or not isinstance(error, SkillError):
        return None
    port = str(error.location[0])
    declared, found = declaration(kind.input_ports()[port]), ""
    items = value.value if isinstance(value.value, list) and value.value else [value]
    joints = {joint.name: joint.unit for joint in robot.joints}
    unit = joints.get(str(error.location[-1]), declared.unit)
    for text, factor in in_smaller_units(items[0].value, unit):
        scaled = {**inputs, port: _scaled(inputs.get(port), factor)}
        numbers = [each.value * factor for each in items if isinstance(each.value, int | float)]
        # The base of the arm is at the origin, so a position is not near it. A size may be small.
        far = declared.least is None and max(map(abs, numbers)) <= robot.reach
        if (far or not found) and _accepts(leaf, robot, scaled, error.location):
            found = text.split()[1]
    return (unit, found) if found else None


def _with_unit(value: Located, unit: str) -> str:
    """Return a value with a unit after each of its numbers."""
    items, numbers = value.value if isinstance(value.value, list) else [value], (int, float)
    texts = [f"{i.value} {unit}" if type(i.value) in numbers else i.as_yaml() for i in items]
    return f"[{', '.join(texts)}]" if isinstance(value.value, list) else texts[0]


def _scaled(value: Any, factor: float) -> Any:
    """Return a value with all its floats multiplied by a factor."""
    if isinstance(value, Mapping):
        changed: Any = copy(value)  # keeps the joints with unknown positions
        changed.update((key, _scaled(each, factor)) for key, each in value.items())
        return changed
    if isinstance(value, list):
        return [_scaled(item, factor) for item in value]
    return value * factor if isinstance(value, float) else value
