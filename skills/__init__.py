"""What the arm can do: the leaves that task files name."""

from .ask import Ask
from .base import Context, Planned, Scene, Scheduled, Skill, SkillEvent
from .bounds import CheckBounds, check_targets
from .causes import as_one, causes_of
from .check_hardware import CheckHardware
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
from .execute import Execute
from .function import Cancel, condition, skill
from .keys import Compare, Set
from .operator import NoOperator, Operator, Question
from .plan_group import PlanArm, PlanGripper
from .ports import Port
from .positions import Positions, three
from .reach_point import ReachPoint
from .say import Fail, Say
from .scene import AddBox, AddCylinder, AddMesh, AddSphere, Attach, Detach, RemoveBody
from .start import SetStart
from .succeed import Succeed
from .targets import Shift, Target
from .wait import Wait

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
