"""Motion planning: a Query in, a Plan out, by worker processes that can be killed at any time.

planner.py    the stages of a plan, from the straight line to the final check
query.py      requests and answers; plan.py the motion that was found; world.py the bodies
workers/      a pool of planner processes
kinematics/   robot model, joint groups, inverse kinematics
collision/    planning scene and collision checks
path/         motion validator, bends, RRT-Connect, shortcutting, parabolic blends
timing/       trapezoidal profiles and TOPP-RA

Importing this package loads no planning library. Only the worker processes do.
"""

from .errors import (
    BadQuery,
    BadWorld,
    Barred,
    EndInCollision,
    GoalInCollision,
    GoalOutOfBounds,
    ModelUnusable,
    MotionCollides,
    MotionError,
    NoPath,
    NotFinite,
    PlanCanceled,
    PlanTimeout,
    StartInCollision,
    StartOutOfBounds,
    Unreachable,
    WorkerDied,
    shown,
)
from .plan import Plan
from .query import Carry, Query, Reached, Request, Rest, Result, ToolQuery, Verify
from .workers.pool import Pool
from .world import EMPTY, Body, Box, Cylinder, Mesh, Shape, Sphere, World

__all__ = [
    "EMPTY",
    "BadQuery",
    "BadWorld",
    "Barred",
    "Body",
    "Box",
    "Carry",
    "Cylinder",
    "EndInCollision",
    "GoalInCollision",
    "GoalOutOfBounds",
    "Mesh",
    "ModelUnusable",
    "MotionCollides",
    "MotionError",
    "NoPath",
    "NotFinite",
    "Plan",
    "PlanCanceled",
    "PlanTimeout",
    "Pool",
    "Query",
    "Reached",
    "Request",
    "Rest",
    "Result",
    "Shape",
    "Sphere",
    "StartInCollision",
    "StartOutOfBounds",
    "ToolQuery",
    "Unreachable",
    "Verify",
    "WorkerDied",
    "World",
    "shown",
]
