"""What the code of skills says before the run, and what becomes of a task where it breaks."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from numbers import Real
from typing import Any, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy

from hardware import Robot
from skills import Context, Skill, SkillBroken, SkillError, known_errors
from skills.motion import Body, MotionError, ToolQuery, shown
from trees.errors import Mistake, Place

from .leaf import Leaf

Fault = SkillError | MotionError
Pose = tuple[float, ...]
_Answer = TypeVar("_Answer")


@dataclass(frozen=True)
class Refusal:
    """One thing that a skill refuses of what a task spells out, or that its code raises.

    Attributes:
        node: Of the skill.
        kind: Name of the skill.
        error: Why.
        place: Where the value stands, as near as is known.
    """

    node: Behaviour
    kind: str
    error: Fault
    place: Place

    @property
    def mistake(self) -> Mistake:
        """The same as a mistake in a file."""
        return Mistake(self.place, f"{self.kind}: {self.error}")


class Asking:
    """Asks skills of one tree. Whatever their code raises, or answers, costs only its own node.

    Args:
        doubtful: Nodes that are known to be wrong.

    Attributes:
        doubtful: Nodes that are wrong, so that nobody knows what they would do.
    """

    def __init__(self, doubtful: Iterable[Behaviour] = ()) -> None:
        self.doubtful = set(doubtful)
        self._refused: dict[tuple[Place, str], Refusal] = {}

    @property
    def mistakes(self) -> list[Mistake]:
        """What was refused as mistakes in files."""
        return [refusal.mistake for refusal in self.refused]

    @property
    def refused(self) -> list[Refusal]:
        """What was refused; what several skills refuse alike is told once."""
        return list(self._refused.values())

    def make(self, kind: type[Skill], name: str, context: Context, place: Place) -> Behaviour:
        """A skill, or what stands for it where its code makes none."""
        made, faults = _answer(kind, "__init__", lambda: kind(name, context), _MADE)
        if made is not None:
            return made
        node = Dummy(name)
        self._refuse(node, kind, [(fault, place) for fault in faults])
        return node

    def judge(self, leaf: Leaf, robot: Robot) -> None:
        """Let a skill judge its inputs."""
        kind = type(leaf.skill)
        inputs = {**leaf.known, **leaf.partly} if kind.validates_partial else leaf.known
        self._ask(leaf, "validate", lambda: kind.validate(robot, inputs), _ANY)

    def shortest(self, leaf: Leaf) -> float:
        """How long a skill takes at least [s]."""
        kind = type(leaf.skill)
        return self._ask(leaf, "shortest", lambda: kind.shortest(leaf.known), _DURATION) or 0.0

    def poses(self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any]) -> list[Pose]:
        """Where inputs send the arm [rad]; nowhere where the skill is doubtful."""
        if leaf.skill in self.doubtful:
            return []
        kind, wanted = type(leaf.skill), _poses_of(len(robot.actuated))
        return self._ask(leaf, "poses", lambda: kind.poses(robot, inputs), wanted) or []

    def waypoints(self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any]) -> list[Pose]:
        """Points on the way to the goal: values of the arm's own joints [rad]."""
        if leaf.skill in self.doubtful:
            return []
        kind, wanted = type(leaf.skill), _poses_of(len(robot.actuated_in("arm")))
        return self._ask(leaf, "waypoints", lambda: kind.waypoints(robot, inputs), wanted) or []

    def tool_query(self, leaf: Leaf, robot: Robot, inputs: Mapping[str, Any]) -> ToolQuery | None:
        """The point that the tool must reach; None if it is not known, or the skill is doubtful."""
        if leaf.skill in self.doubtful:
            return None
        kind = type(leaf.skill)
        return self._ask(leaf, "tool_query", lambda: kind.tool_query(robot, inputs), _TOOL_QUERY)

    def body(self, leaf: Leaf) -> Body | None:
        """What a skill puts into the world; nothing where it is doubtful."""
        if leaf.skill in self.doubtful:
            return None
        kind = type(leaf.skill)
        return self._ask(leaf, "body", lambda: kind.body(leaf.known), _BODY)

    def _ask(
        self, leaf: Leaf, what: str, call: Callable[[], _Answer], wanted: "_Wanted"
    ) -> _Answer | None:
        answer, faults = _answer(type(leaf.skill), what, call, wanted)
        self._refuse(leaf.skill, type(leaf.skill), [(each, _place(leaf, each)) for each in faults])
        return answer

    def _refuse(
        self, node: Behaviour, kind: type[Skill], faults: Iterable[tuple[Fault, Place]]
    ) -> None:
        for fault, place in faults:
            self.doubtful.add(node)
            refusal = Refusal(node, kind.__name__, fault, place)
            self._refused.setdefault((place, str(fault)), refusal)


@dataclass(frozen=True)
class _Wanted:
    """An answer that is one.

    Attributes:
        words: What it is.
        fits: Whether something is that.
    """

    words: str
    fits: Callable[[Any], bool]


def _answer(
    kind: type[Skill], what: str, call: Callable[[], _Answer], wanted: _Wanted
) -> tuple[_Answer | None, Sequence[Fault]]:
    """What somebody's code answers, or what it refuses; what it raises else counts as that, too."""
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


def _poses_of(joints: int) -> _Wanted:
    """Poses of a robot of so many actuated joints."""

    def fits(poses: object) -> bool:
        return isinstance(poses, list) and all(map(is_pose, poses))

    def is_pose(pose: Any) -> bool:
        numbers = isinstance(pose, tuple) and len(pose) == joints
        return numbers and all(map(_is_finite, pose))

    return _Wanted(f"a list of tuples of {joints} numbers", fits)


def _is_finite(number: Any) -> bool:
    """Whether it is a number that a float can hold."""
    try:
        return isinstance(number, Real) and isfinite(number)
    except OverflowError:
        return False


def _is_duration(least: Any) -> bool:
    return _is_finite(least) or (isinstance(least, Real) and least == inf)


def _is_made(made: object) -> bool:
    return isinstance(made, Skill) and {"id", "context"} <= vars(made).keys()


_ANY = _Wanted("anything", lambda _: True)
_MADE = _Wanted("what super().__init__(name, context) makes", _is_made)
_DURATION = _Wanted("a number", _is_duration)
_TOOL_QUERY = _Wanted(
    "a ToolQuery or None", lambda query: query is None or isinstance(query, ToolQuery)
)
_BODY = _Wanted("a Body or None", lambda body: body is None or isinstance(body, Body))


def _place(leaf: Leaf, error: Fault) -> Place:
    """Where the value stands that a skill refuses, as near as is known."""
    port, *within = error.location if isinstance(error, SkillError) and error.location else ("",)
    value = leaf.written.get(str(port))
    if value is None:
        return leaf.place
    place = value.place
    for step in within:
        if isinstance(value.value, dict) and step in value.value:
            value = value.value[str(step)]
            place = value.label
        elif isinstance(value.value, list) and isinstance(step, int):
            value = value.value[step]
            place = value.place
    return place
