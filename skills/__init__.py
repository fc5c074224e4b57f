"""Skills: the leaves that task files name, and the interface to write more of them."""

from .base import Skill, WorldChange
from .context import Context, Planned, Scheduled, SkillEvent
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
from .leaves.reach_point import TOOL_PORTS, check_tool, tool_query
from .leaves.target import check_distances, check_joints
from .operator import NoOperator, Operator, Question
from .ports import Port, Positions

__all__ = [
    "TOOL_PORTS",
    "BadBody",
    "BadQuestion",
    "BadTarget",
    "Cancel",
    "ConditionFails",
    "Context",
    "FunctionFailed",
    "Interrupted",
    "NoOperator",
    "Operator",
    "OutOfBounds",
    "Planned",
    "Port",
    "Positions",
    "Question",
    "Scheduled",
    "Skill",
    "SkillBroken",
    "SkillError",
    "SkillEvent",
    "StartMoved",
    "TaskFailed",
    "TookTooLong",
    "Unanswered",
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
]
