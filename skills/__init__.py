"""Skills: the leaves that task files name, and the interface to write more of them."""

from .base import Skill, WorldChange
from .context import Context, Planned, Scene, Scheduled, SkillEvent
from .errors import (
    BadBody,
    BadQuestion,
    BadTarget,
    ConditionFails,
    FunctionFailed,
    Interrupted,
    OutOfBounds,
    SkillBroken,
    SkillError,
    StartMoved,
    TaskFailed,
    TookTooLong,
    Unanswered,
    combine_errors,
    known_errors,
    refuse,
)
from .function import Cancel, condition, skill
from .joint_targets import check_targets
from .leaves.ask import Ask
from .leaves.blackboard import Compare, Set
from .leaves.check_bounds import CheckBounds
from .leaves.check_hardware import CheckHardware
from .leaves.execute import Execute
from .leaves.plan_group import PlanArm, PlanGripper
from .leaves.reach_point import TOOL_PORTS, ReachPoint, check_tool, tool_query
from .leaves.result import Fail, Succeed
from .leaves.say import Say
from .leaves.scene import AddBox, AddCylinder, AddMesh, AddSphere, Attach, Detach, RemoveBody
from .leaves.set_start import SetStart
from .leaves.target import Shift, Target, check_distances, check_joints
from .leaves.wait import Wait
from .operator import NoOperator, Operator, Question
from .ports import Port, Positions, xyz

__all__ = [
    "TOOL_PORTS",
    "AddBox",
    "AddCylinder",
    "AddMesh",
    "AddSphere",
    "Ask",
    "Attach",
    "BadBody",
    "BadQuestion",
    "BadTarget",
    "Cancel",
    "CheckBounds",
    "CheckHardware",
    "Compare",
    "ConditionFails",
    "Context",
    "Detach",
    "Execute",
    "Fail",
    "FunctionFailed",
    "Interrupted",
    "NoOperator",
    "Operator",
    "OutOfBounds",
    "PlanArm",
    "PlanGripper",
    "Planned",
    "Port",
    "Positions",
    "Question",
    "ReachPoint",
    "RemoveBody",
    "Say",
    "Scene",
    "Scheduled",
    "Set",
    "SetStart",
    "Shift",
    "Skill",
    "SkillBroken",
    "SkillError",
    "SkillEvent",
    "StartMoved",
    "Succeed",
    "Target",
    "TaskFailed",
    "TookTooLong",
    "Unanswered",
    "Wait",
    "WorldChange",
    "check_distances",
    "check_joints",
    "check_targets",
    "check_tool",
    "combine_errors",
    "condition",
    "known_errors",
    "refuse",
    "skill",
    "tool_query",
    "xyz",
]
