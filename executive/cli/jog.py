"""`armtree jog`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .move import find_server
from .support.options import run_options, source_options
from .support.settings import ABOVE_0, option

if TYPE_CHECKING:
    from executive.api.events import Where


@click.command()
@click.option(
    "--speed",
    type=ABOVE_0,
    default=1.0,
    show_default=True,
    help="Share of the robot's speed, 0.01 to 1.",
)
@option("server", show_envvar=True)
@source_options
@run_options
def jog(server: str | None, speed: float, **options: Any) -> None:
    """Move joints and tool in small steps, by keys.

    Each step is a move: planned, checked and recorded. If a server runs on this machine, its arm
    moves, unless --port is given. Otherwise the first step opens the port, which may move the arm.

    \b
      <- ->        move by a step        space  stop
      up, down     choose what moves     h      home
      1 to 9       choose a joint        o, c   gripper
      x, y, z      choose the tool       s      save the pose
      +, -         size of a step        q      leave

    Ctrl-C stops the arm and leaves. The arm then holds its pose.
    """  # noqa: D301
    from hardware import NotActive, load_robot
    from trees.export.saved_poses import save_pose

    from .support.run_jog import run_jog
    from .terminal.jog_model import Command

    robot, folder = load_robot(options.pop("robot")), options["trees"] or Path("trees")

    def save(where: "Where", name: str) -> str:
        if not where.commanded:
            raise NotActive("The pose of an inactive arm is not known; move it first")
        if where.units.keys() != {joint.name for joint in robot.actuated}:
            why = f"the server has another arm than {robot.name}; give its robot file with --robot"
            raise click.UsageError(why)
        arm = {joint.name: where.commanded[joint.name] for joint in robot.actuated_in("arm")}
        return f"Saved the pose {name} of the arm to {save_pose(robot, folder, name, arm)}"

    commands = {"s": (Command("save pose", "Name of the pose"), save)}
    sys.exit(run_jog(find_server(server), {**options, "robot": robot}, speed, commands))
