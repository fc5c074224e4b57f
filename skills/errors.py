"""What can go wrong in a skill.

SkillError
├── OutOfBounds     a target lies outside the limits
├── BadTarget       a target names no joint, the wrong one, or contradicts itself
├── StartMoved      the arm no longer stands where the plan begins
└── Interrupted     somebody stopped the motion from outside the tree
"""


class SkillError(Exception):
    """Root of what skills raise; a failed skill keeps its `code` and message."""

    code = "skill.error"


class OutOfBounds(SkillError):
    """A target lies outside the limits of its joints."""

    code = "goal.out_of_bounds"


class BadTarget(SkillError):
    """A target names an unknown joint, leaves one out, or contradicts a mimic joint's leader."""

    code = "goal.bad_target"


class StartMoved(SkillError):
    """The arm no longer stands where the plan begins."""

    code = "plan.start_moved"


class Interrupted(SkillError):
    """The motion was stopped from outside the tree."""

    code = "hw.stopped"
