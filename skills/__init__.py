"""What the arm can do: the leaves that task files name."""

from .base import Context, Planned, Scheduled, Skill, SkillEvent
from .bounds import CheckBounds, check_targets
from .errors import BadTarget, Interrupted, OutOfBounds, SkillError, StartMoved
from .execute import Execute
from .plan_group import PlanArm, PlanGripper
from .positions import Positions
from .start import SetStart
from .succeed import Succeed

__all__ = [
    "BadTarget",
    "CheckBounds",
    "Context",
    "Execute",
    "Interrupted",
    "OutOfBounds",
    "PlanArm",
    "PlanGripper",
    "Planned",
    "Positions",
    "Scheduled",
    "SetStart",
    "Skill",
    "SkillError",
    "SkillEvent",
    "StartMoved",
    "Succeed",
    "check_targets",
]
