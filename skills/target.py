"""Targets that are not given as joint values: they become some."""

from py_trees.common import Status
from py_trees.ports import PortInformation

from .base import Skill
from .errors import BadTarget
from .motion import MotionError, Reached, Result, ToolQuery
from .pending import Asking
from .positions import Positions, three

_GROUP = PortInformation(str, default_value="arm", description="group whose joints are meant")
_START = PortInformation(Positions, description="where the arm stands [rad]")
_TARGET = PortInformation(Positions, description="position of each of the group's joints [rad]")


class Relative(Skill):
    """A target by so much from where the arm stands; joints that are not named stay."""

    INPUT_PORTS = {
        "start": _START,
        "by": PortInformation(Positions, description="change of the joints named [rad]"),
        "group": _GROUP,
    }
    OUTPUT_PORTS = {"target": _TARGET}

    def on_start(self) -> Status:
        """Add."""
        robot, group = self.context.robot, self.get_input("group")
        start, by = self.get_input("start"), self.get_input("by")
        names = _leaders(self, group)
        for name in by:
            if name not in names:
                there = ", ".join(names)
                raise BadTarget(
                    f"{name} is no joint of the {group} that can move by itself; there are {there}"
                )
        joints = robot.leaders(group)
        self._set_output(
            "target", Positions((j.name, start[j.name] + by.get(j.name, 0.0)) for j in joints)
        )
        return Status.SUCCESS


class ReachPoint(Asking):
    """The joint positions, soonest reached, that bring the tool to a point in the room."""

    INPUT_PORTS = {
        "start": _START,
        "point": PortInformation(
            list[float], description="x, y, z in the frame of the robot's root [m]"
        ),
        "relative": PortInformation(
            bool, default_value=False, description="whether it counts from where the tool is"
        ),
        "direction": PortInformation(
            list[float],
            default_value=[],
            description="x, y, z that the tool's axis shall point along; empty for any",
        ),
        "tool": PortInformation(
            str, default_value="", description="link with the tool; empty for the group's last"
        ),
        "offset": PortInformation(
            list[float], default_value=[0.0, 0.0, 0.0], description="the tool on that link [m]"
        ),
        "axis": PortInformation(
            list[float], default_value=[0.0, 0.0, 1.0], description="the tool's axis on that link"
        ),
        "group": _GROUP,
    }
    OUTPUT_PORTS = {"target": _TARGET}

    def on_start(self) -> Status:
        """Hand the question to a worker."""
        given = {port: self.get_input(port) for port in self.INPUT_PORTS}
        self._names = _leaders(self, given["group"])
        start, robot = given["start"], self.context.robot
        return self.ask(
            ToolQuery(
                group=given["group"],
                start=tuple(start[joint.name] for joint in robot.actuated),
                point=three("point", given["point"]),
                direction=three("direction", given["direction"]) if given["direction"] else None,
                link=given["tool"],
                offset=three("offset", given["offset"]),
                axis=three("axis", given["axis"]),
                relative=given["relative"],
                seed=self.context.seed,
                timeout=self.context.timeout,
                world=self.context.scene.world,
            )
        )

    def on_answer(self, answer: Result) -> Status:
        """Hand the positions on."""
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, Reached)
        target = Positions(zip(self._names, answer.positions, strict=True))
        self._set_output("target", target)
        self.feedback_message = ", ".join(f"{name} {q:.3f}" for name, q in target.items())
        return Status.SUCCESS


def _leaders(skill: Skill, group: str) -> list[str]:
    """Names of the joints of a group that move of their own."""
    robot = skill.context.robot
    if group not in robot.groups:
        raise BadTarget(f"the robot has no group {group}; it has {', '.join(robot.groups)}")
    return [joint.name for joint in robot.leaders(group)]
