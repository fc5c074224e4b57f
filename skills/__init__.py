"""What the arm can do: the leaves that task files name."""

from .base import Context, Planned, Scene, Scheduled, Skill, SkillEvent
from .bounds import CheckBounds, check_targets
from .errors import BadTarget, Interrupted, OutOfBounds, SkillError, StartMoved
from .execute import Execute
from .plan_group import PlanArm, PlanGripper
from .positions import Positions, three
from .scene import AddBox, AddCylinder, AddMesh, AddSphere, Attach, Detach, RemoveBody
from .start import SetStart
from .succeed import Succeed
from .target import ReachPoint, Relative

__all__ = [
    "AddBox",
    "AddCylinder",
    "AddMesh",
    "AddSphere",
    "Attach",
    "BadTarget",
    "CheckBounds",
    "Context",
    "Detach",
    "Execute",
    "Interrupted",
    "OutOfBounds",
    "PlanArm",
    "PlanGripper",
    "Planned",
    "Positions",
    "ReachPoint",
    "Relative",
    "RemoveBody",
    "Scene",
    "Scheduled",
    "SetStart",
    "Skill",
    "SkillError",
    "SkillEvent",
    "StartMoved",
    "Succeed",
    "check_targets",
    "three",
]
