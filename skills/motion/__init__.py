"""Motion planning: a Query in, a Plan out, by worker processes that can be ended at any time.

Importing this loads no planning library; only the worker processes do.
"""

from .errors import (
    BadQuery,
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
    WorkerDied,
)
from .plan import Plan
from .pool import Job, Pool
from .process import Request, Result
from .query import Query, Verify

__all__ = [
    "BadQuery",
    "EndInCollision",
    "GoalInCollision",
    "GoalOutOfBounds",
    "Job",
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
    "Request",
    "Result",
    "StartInCollision",
    "StartOutOfBounds",
    "Verify",
    "WorkerDied",
]
