"""`armtree teleop`."""

import sys
from pathlib import Path
from typing import Any

import click

from .settings import PATH
from .support.command_group import command
from .support.names import complete_port
from .support.options import run_options, source_options, speed_option


@command()
@click.option(
    "--leader",
    metavar="PORT",
    required=True,
    shell_complete=complete_port,
    help="Port of the arm that you move by hand.",
)
@click.option(
    "--leader-robot",
    metavar="FILE",
    type=PATH,
    help="Robot file of the leader, for its own calibration. Default: --robot.",
)
@speed_option
@source_options
@run_options
def teleop(leader: str, leader_robot: Path | None, speed: float, **options: Any) -> None:
    """Move an arm by moving another arm, the leader, by hand.

    The arm at --port is activated. Then the leader loses its torque, so hold the leader. The arm
    first moves to the position of the leader, on a planned path, and then follows the leader within
    the limits of the robot file. Every step is checked for collision before it is sent, and
    recorded. Before a collision the arm stops, and arrows show in which direction each joint is
    free. The arm follows again when the leader is back at a free position.

    \b
      space  hold, or follow again
      q      leave

    If the leader is unplugged, at Ctrl-C, or if the terminal is closed, the arm holds its pose.

    \b
    Example:
      armtree teleop --robot so101 --leader /dev/ttyACM1
    """  # noqa: D301
    from .teleoperation.run_teleop import run_teleop

    sys.exit(run_teleop(leader, leader_robot, speed, options))
