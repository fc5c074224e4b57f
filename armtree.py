"""The public Python interface of armtree. `python -m armtree` is the command line.

with armtree.Arm() as arm:
    result = arm.run("pick")
"""

import importlib.util
import os
import sys
import typing

# The packages of armtree are in the folder of this file, or, if it is installed, in armtree_rooms.
# That folder comes last in sys.path, so that another package named `logs` still imports under its
# name. armtree then raises ImportError.
_FOLDER = os.path.dirname(os.path.abspath(__file__))
if os.path.isdir(_installed := os.path.join(_FOLDER, "armtree_rooms")):
    _FOLDER = _installed
    if _FOLDER not in sys.path:
        sys.path.append(_FOLDER)
for _room in ("executive", "hardware", "logs", "skills", "trees"):
    _found = importlib.util.find_spec(_room)
    _places = (
        list(_found.submodule_search_locations or [str(_found.origin)]) if _found else [_FOLDER]
    )
    if os.path.join(_FOLDER, _room) not in _places:
        raise ImportError(
            f"Another package named {_room} hides the package {_room} of armtree: {_places[0]}. If "
            "that package is yours, rename it. If not, install armtree into an environment of its "
            "own: pipx install, or uv tool install"
        )

# Each name is imported at its first use. A client does not wait for imports that only an arm needs.
if typing.TYPE_CHECKING:
    from executive.api.events import Event as Event, Status as Status, Where as Where
    from executive.api.move import Move as Move
    from executive.api.outcome import (
        CancelCode as CancelCode,
        CancelResult as CancelResult,
        Cause as Cause,
        GoalState as GoalState,
        GoalStatus as GoalStatus,
        Outcome as Outcome,
    )
    from executive.arm import Arm as Arm
    from executive.client.asynchronous import AsyncClient as AsyncClient
    from executive.client.synchronous import Client as Client
    from executive.client.values import (
        OpenQuestion as OpenQuestion,
        PlannedTask as PlannedTask,
        Task as Task,
    )
    from executive.errors import (
        ClientError as ClientError,
        GoalError as GoalError,
        GoalFailed as GoalFailed,
        Refused as Refused,
        ServerUnreachable as ServerUnreachable,
    )
    from executive.testing import SimulatedArm as SimulatedArm
    from hardware import HardwareError as HardwareError, Robot as Robot
    from hardware.errors import ArmtreeError as ArmtreeError
    from logs import LogError as LogError
    from skills import (
        Cancel as Cancel,
        Operator as Operator,
        Port as Port,
        Positions as Positions,
        Question as Question,
        Skill as Skill,
        SkillBroken as SkillBroken,
        SkillError as SkillError,
        TaskFailed as TaskFailed,
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

    __all__: list[str]
else:

    def __getattr__(name):
        from hardware.loading.lazy_exports import lazy_exports

        return lazy_exports(__name__)(name)


def __dir__() -> list[str]:
    return sorted(sys.modules[__name__].__all__)


def main() -> None:
    """Entry point of the command `armtree`. A Ctrl-C while it loads prints no traceback."""
    try:
        from executive.cli.start import start

        start()
    except KeyboardInterrupt:
        from executive.api.codes import INTERRUPTED_EXIT

        sys.exit(INTERRUPTED_EXIT)


if __name__ == "__main__":
    main()
