"""The public Python interface of armtree. `python -m armtree` is the command line.

with armtree.Arm() as arm:
    result = arm.run("pick")
"""

import importlib
import typing

if typing.TYPE_CHECKING:
    from executive.arm import Arm
    from executive.client.asynchronous import AsyncClient
    from executive.client.synchronous import Client
    from executive.errors import (
        ClientError,
        GoalError,
        GoalFailed,
        Refused,
        ServerUnreachable,
    )
    from executive.goals.outcome import Cause, Outcome
    from executive.testing import SimulatedArm
    from hardware import HardwareError
    from logs import LogError
    from skills import Cancel, Operator, Question, Skill, SkillError, condition, skill
    from skills.motion import MotionError
    from trees import EXAMPLES, FileError, TreeError, UnknownTask

__all__ = [
    "EXAMPLES",
    "Arm",
    "AsyncClient",
    "Cancel",
    "Cause",
    "Client",
    "ClientError",
    "FileError",
    "GoalError",
    "GoalFailed",
    "HardwareError",
    "LogError",
    "MotionError",
    "Operator",
    "Outcome",
    "Question",
    "Refused",
    "ServerUnreachable",
    "SimulatedArm",
    "Skill",
    "SkillError",
    "TreeError",
    "UnknownTask",
    "condition",
    "skill",
]

# Loaded at their first use, so that a client does not wait for what only an arm needs.
_MODULES = {
    "executive.arm": ("Arm",),
    "executive.client.asynchronous": ("AsyncClient",),
    "executive.client.synchronous": ("Client",),
    "executive.errors": ("ClientError", "GoalError", "GoalFailed", "Refused", "ServerUnreachable"),
    "executive.goals.outcome": ("Cause", "Outcome"),
    "executive.testing": ("SimulatedArm",),
    "hardware": ("HardwareError",),
    "logs": ("LogError",),
    "skills": ("Cancel", "Operator", "Question", "Skill", "SkillError", "condition", "skill"),
    "skills.motion": ("MotionError",),
    "trees": ("EXAMPLES", "FileError", "TreeError", "UnknownTask"),
}


def __getattr__(name: str) -> typing.Any:
    for module, names in _MODULES.items():
        if name in names:
            globals()[name] = value = getattr(importlib.import_module(module), name)
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__


if __name__ == "__main__":
    from executive.__main__ import main

    main()
