"""What the arm can do: the leaves that task files name."""

from .base import Context, Planned, Scene, Scheduled, Skill, SkillEvent
from .causes import as_one, causes_of
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
    refuse,
)
from .function import Cancel, condition, skill
from .leaves.ask import Ask
from .leaves.check_bounds import CheckBounds, check_targets
from .leaves.check_hardware import CheckHardware
from .leaves.execute import Execute
from .leaves.keys import Compare, Set
from .leaves.plan_group import PlanArm, PlanGripper
from .leaves.reach_point import ReachPoint
from .leaves.say import Fail, Say
from .leaves.scene import AddBox, AddCylinder, AddMesh, AddSphere, Attach, Detach, RemoveBody
from .leaves.set_start import SetStart
from .leaves.succeed import Succeed
from .leaves.targets import Shift, Target
from .leaves.wait import Wait
from .operator import NoOperator, Operator, Question
from .ports import Port
from .positions import Positions, three

__all__ = [
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
    "as_one",
    "causes_of",
    "check_targets",
    "condition",
    "refuse",
    "skill",
    "three",
]
