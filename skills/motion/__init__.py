"""Motion planning: a Query in, a Plan out, by worker processes that can be ended at any time.

Importing this loads no planning library; only the worker processes do.
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
    OutOfBounds,
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
from .workers.pool import Job, Pool
from .world import EMPTY, Body, Box, Cylinder, Mesh, Shape, Sphere, World, quaternion

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
    "Job",
    "Mesh",
    "ModelUnusable",
    "MotionCollides",
    "MotionError",
    "NoPath",
    "NotFinite",
    "OutOfBounds",
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
    "quaternion",
    "shown",
]
