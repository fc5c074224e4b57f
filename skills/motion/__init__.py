"""Motion planning: worker processes turn a Query into a Plan. They can be killed at any time.

planner.py    the stages of a plan, from the straight line to the final check
query.py      requests and answers; world.py the bodies
trajectory/   plan.py, the motion that was found: its curve and its time law
workers/      a pool of planner processes
robot_model/  the robot for planning: joint groups, shapes, lever arms
inverse_kinematics.py   joint positions for a tool position
collision/    planning scene and collision checks
path/         motion validator, bends, RRT-Connect, shortcutting, parabolic blends
timing/       trapezoidal profiles, TOPP-RA, and timing again after a pause

Importing this package loads no planning library. Only the worker processes do.
"""

from .errors import (
    BadQuery as BadQuery,
    BadWorld as BadWorld,
    Barred as Barred,
    EndInCollision as EndInCollision,
    GoalInCollision as GoalInCollision,
    GoalOutOfBounds as GoalOutOfBounds,
    ModelUnusable as ModelUnusable,
    MotionCollides as MotionCollides,
    MotionError as MotionError,
    NoPath as NoPath,
    NotFinite as NotFinite,
    PlanCanceled as PlanCanceled,
    PlanTimeout as PlanTimeout,
    StartInCollision as StartInCollision,
    StartOutOfBounds as StartOutOfBounds,
    TooLittleMemory as TooLittleMemory,
    TooLong as TooLong,
    Unreachable as Unreachable,
    WorkerDied as WorkerDied,
    shown as shown,
)
from .query import (
    Carry as Carry,
    Query as Query,
    Reached as Reached,
    Request as Request,
    Rest as Rest,
    Result as Result,
    ToolQuery as ToolQuery,
    Verify as Verify,
)
from .trajectory.plan import Plan as Plan
from .workers.pool import Pool as Pool
from .world import (
    EMPTY as EMPTY,
    Body as Body,
    Box as Box,
    Cylinder as Cylinder,
    Mesh as Mesh,
    Shape as Shape,
    Sphere as Sphere,
    World as World,
)
