"""`armtree ros2`."""

import sys
from pathlib import Path

import click

from .support.command_group import command
from .support.options import robot_option, server_option
from .support.process import replace_process, signal_status
from .terminal.streams import echo


@command()
@click.argument("ros_arguments", metavar="[-- ROS_ARGUMENTS]", nargs=-1, type=click.UNPROCESSED)
@robot_option
@server_option
def ros2(ros_arguments: tuple[str, ...], robot: Path | None, server: str) -> None:
    """Offer a server to ROS 2, as the node `armtree`.

    Start `armtree serve` first. The node has the action task_server (ArduinobotTask), the topics
    joint_states and robot_description, the lifecycle of the hardware, a service ~/run_NAME for
    every task, and ~/stop. The goals of the node are canceled if this command ends, or loses the
    server.

    The command uses the sourced ROS 2, or the ROS 2 that `make ros2` installed. Programs of ROS
    need no token. Therefore only programs on this machine find the node, unless
    ROS_AUTOMATIC_DISCOVERY_RANGE is set.

    \b
    Examples:
      armtree ros2
      armtree ros2 -- --ros-args -r __ns:=/left
    """  # noqa: D301
    from executive.ros2 import installation

    if not installation.is_ready():
        environment = installation.environment()
        if environment is None:
            raise click.UsageError(
                "there is no ROS 2: source one, type `make ros2` in the repository, "
                "or install the wheel again with [ros2] behind its name"
            )
        replace_process(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment)
    import asyncio

    from hardware import load_robot

    stays = installation.stay_on_this_machine()
    try:
        from executive.ros2.node import BadRosArguments
        from executive.ros2.run import run
    except ImportError as error:
        why = f"{error}".splitlines()[0]
        python = "{}.{}".format(*sys.version_info)
        words = f"this ROS 2 is incomplete, or not for Python {python}, which runs armtree: {why}"
        raise click.UsageError(words) from error
    if not stays:
        echo("Programs on other machines can find this node, and move the arm.", err=True)
    try:
        sys.exit(signal_status(asyncio.run(run(server, load_robot(robot), ros_arguments))))
    except BadRosArguments as error:
        raise click.UsageError(f"ROS refuses the arguments after --: {error}") from error
