"""The public Python interface of armtree. `python -m armtree` is the command line.

with armtree.Arm() as arm:
    result = arm.run("pick")
"""

import importlib
import typing

if typing.TYPE_CHECKING:
    from executive.api.outcome import Cause as Cause, Outcome as Outcome
    from executive.arm import Arm as Arm
    from executive.client.asynchronous import AsyncClient as AsyncClient
    from executive.client.synchronous import Client as Client
    from executive.errors import (
        ClientError as ClientError,
        GoalError as GoalError,
        GoalFailed as GoalFailed,
        Refused as Refused,
        ServerUnreachable as ServerUnreachable,
    )
    from executive.testing import SimulatedArm as SimulatedArm
    from hardware import HardwareError as HardwareError
    from logs import LogError as LogError
    from skills import (
        Cancel as Cancel,
        Operator as Operator,
        Question as Question,
        Skill as Skill,
        SkillError as SkillError,
        condition as condition,
        skill as skill,
    )
    from skills.motion import MotionError as MotionError
    from trees import (
        EXAMPLES as EXAMPLES,
        FileError as FileError,
        TreeError as TreeError,
        UnknownTask as UnknownTask,
    )

# Loaded at their first use, so that a client does not wait for what only an arm needs.
_MODULES = {
    "executive.arm": ("Arm",),
    "executive.client.asynchronous": ("AsyncClient",),
    "executive.client.synchronous": ("Client",),
    "executive.errors": ("ClientError", "GoalError", "GoalFailed", "Refused", "ServerUnreachable"),
    "executive.api.outcome": ("Cause", "Outcome"),
    "executive.testing": ("SimulatedArm",),
    "hardware": ("HardwareError",),
    "logs": ("LogError",),
    "skills": ("Cancel", "Operator", "Question", "Skill", "SkillError", "condition", "skill"),
    "skills.motion": ("MotionError",),
    "trees": ("EXAMPLES", "FileError", "TreeError", "UnknownTask"),
}

__all__ = [name for names in _MODULES.values() for name in names]


def __getattr__(name: str) -> typing.Any:
    for module, names in _MODULES.items():
        if name in names:
            globals()[name] = value = getattr(importlib.import_module(module), name)
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


if __name__ == "__main__":
    from executive.__main__ import main

    main()
