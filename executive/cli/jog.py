"""`armtree jog`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .move import check_arm
from .settings import option
from .support.command_group import command
from .support.options import run_options, source_options, speed_option

if TYPE_CHECKING:
    from executive.api.events import Where
    from executive.cli.jogging.model import KeyCommand
    from executive.cli.jogging.screen import Act
    from hardware import Robot


@command()
@speed_option
@option("server")
@source_options
@run_options
def jog(server: str | None, speed: float, **options: Any) -> None:
    """Move joints and tool in small steps, by keys.

    Each step is a move: planned, checked and recorded. Of the keys pressed during a move, only the
    last one acts, when the move ends; s then saves the pose at the end of the move. If a server
    runs on this machine, its arm moves, unless --port is given. Otherwise the first step opens the
    port, which may move the arm. An arm with more than three joints also turns its tool in place:
    about its axis (roll) and upwards (pitch). With six joints or more, it also turns the tool about
    the vertical (yaw).

    \b
      <- ->        move by a step        space  stop
      up, down     choose what moves     h      home
      1 to 9       choose a joint        o, c   gripper
      x, y, z      choose the tool       s      save the pose
      +, -         size of a step        q      leave

    Ctrl-C stops the arm and leaves. The arm then holds its pose.
    """  # noqa: D301
    from hardware import load_robot

    from .jogging.run_jog import run_jog
    from .support.server_requests import find_server

    robot, folder = load_robot(options.pop("robot")), options["trees"] or Path("trees")
    commands = saving(robot, folder)
    setup = {**options, "robot": robot}
    sys.exit(run_jog(find_server(server), setup, speed, lambda _arm: commands))


def saving(robot: "Robot", folder: Path) -> "dict[str, tuple[KeyCommand, Act]]":
    """Return the command that saves a pose to a folder of tasks, in a dictionary by its key."""
    from executive.goals.moves.poses import save_where
    from trees.writing.saved_poses import PoseExists

    from .jogging.model import KeyCommand
    from .jogging.screen import ConfirmationNeeded

    def save(where: "Where", name: str) -> str:
        check_arm(robot, where)

        def saved(replace: bool) -> str:
            path, positions = save_where(robot, where, folder, name, "arm", replace)
            alone = " without gripper" if len(positions) < len(robot.actuated) else ""
            return f"Saved {name} (arm{alone}) to {path}"

        try:
            return saved(replace=False)
        except PoseExists:
            raise ConfirmationNeeded(
                f"Replace the pose {name}?", lambda: saved(replace=True)
            ) from None

    return {"s": (KeyCommand("save pose", "Name of the pose", "saves the pose"), save)}
