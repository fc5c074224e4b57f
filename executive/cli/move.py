"""The commands for the arm that need no task: move, home, where and stop."""

import sys
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.code_table import exit_status

from .settings import option
from .support.command_group import command, diagnostics
from .support.failures import Refusal
from .support.names import complete_target
from .support.options import (
    recordings_option,
    robot_option,
    run_options,
    source_options,
    speed_option,
    target_argument,
)
from .terminal.streams import echo, echo_result

if TYPE_CHECKING:
    from executive.api.events import Where
    from executive.api.move import Move
    from hardware import Robot


def _moving(function: Callable[..., "Move"]) -> Callable[..., None]:
    """Add the options of a move to a command. Execute the move that the command returns."""

    @speed_option
    @option("server")
    @source_options
    @run_options
    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object per event.")
    @wraps(function)
    def command(server: str | None, as_json: bool, **options: Any) -> None:
        own = {
            name: options.pop(name) for name in ("target", "relative", "speed") if name in options
        }
        verbose = diagnostics().verbose
        from .support.server_requests import find_server

        sys.exit(_execute(function(**own), find_server(server), options, as_json, verbose))

    return command


def _execute(
    move: "Move", server: str | None, options: dict[str, Any], as_json: bool, verbose: bool
) -> int:
    """Execute a move on a server, or on an arm of this command. Return the exit status."""
    if server is None:
        from executive.setup import Setup

        from .support.run_tasks import execute

        setup = Setup(**options, reload=False, single_user=True)
        outcome = execute(setup, [move], as_json=as_json, verbose=verbose)[-1]
        return exit_status(outcome.code)
    from executive.client.synchronous import Client

    from .support.server_goals import send_and_wait

    with Client(server) as client:
        if not as_json:
            echo(f"Server {client.url}")
        outcome = send_and_wait(client, move, (), False, as_json, verbose)
    return exit_status(outcome.code)


@command(context_settings={"ignore_unknown_options": True})  # -0.1 is a number, not an option
@target_argument("target", complete_target)
@click.option(
    "--by", "relative", is_flag=True, help="TARGET is a change from the current position."
)
@_moving
def move(target: tuple[str, ...], relative: bool, speed: float) -> "Move":
    """Move joints, or the tool to a point, and record the move.

    The motion is planned and checked like a task. Ctrl-C stops the arm. If a server runs on this
    machine, its arm moves, unless --port is given. TARGET is one of:

    \b
      JOINT=VALUE, JOINT+=CHANGE  joints; others do not move
      POSE                        a saved pose, or home
      width=VALUE                 distance between the fingers
      X Y Z                       a point for the tool
      roll+=ANGLE                 turn the tool; or pitch, yaw

    Numbers without a unit are in rad and m. Joints and poses can be combined.

    \b
    Examples:
      armtree move joint_1=70deg joint_2=-10deg --speed 0.2
      armtree move --by joint_1=5deg
      armtree move --by pitch=-10deg
      armtree move folded
      armtree move open
      armtree move width=20mm
      armtree move 0.1 0.05 8cm
    """  # noqa: D301
    from executive.api.move import Move

    return Move(target, relative, speed)


@command()
@_moving
def home(speed: float) -> "Move":
    """Move to the home pose of the robot.

    The home pose is the pose `home` in your poses.yaml. If there is none, it is `home` in the robot
    file. If there is none either, it is the start pose.
    """
    from executive.api.move import HOME, Move

    return Move((HOME,), speed=speed)


@command()
@option("server")
@robot_option
@recordings_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def where(server: str | None, as_json: bool, **options: Any) -> None:
    """Print where the arm is: joints in degrees, the tool and the width of the gripper in mm.

    The pose comes from the server on this machine. If no server runs, it is the last pose in the
    recordings.
    """
    found, source = find_arm(server, **options)
    echo_result(as_json, found.to_json(), *_where_lines(found, source))


def find_arm(server: str | None, robot: Path | None, recordings: Path) -> "tuple[Where, str]":
    """Return the pose of the arm and its source: a server, or the newest recording with a pose.

    Raises:
        Refusal: Several servers run on this machine, or the server has another robot.
        ClientError: The server does not answer, or no server runs and no recording has a pose.
    """
    from executive.client.synchronous import Client

    from .support.server_requests import find_server

    if url := find_server(server):
        with Client(url) as client:
            return client.where(), f"server {client.url}"
    return _recorded(robot, recordings)


def check_arm(robot: "Robot", where: "Where") -> None:
    """Check that a position is of this robot.

    Raises:
        Refusal: The position is of another arm.
    """
    if where.units.keys() != {joint.name for joint in robot.actuated}:
        why = f"the server has another arm than {robot.name}; give --robot with the file of its arm"
        raise Refusal(why)


def _recorded(robot: Any, recordings: Any) -> "tuple[Where, str]":
    """Return the last recorded pose, and its source.

    Raises:
        ServerUnreachable: No recording has a pose.
    """
    from executive.api.events import Where
    from executive.errors import ServerUnreachable
    from executive.goals.start_pose import last_command
    from hardware import State, load_robot

    arm: Robot = load_robot(robot)
    last = last_command(arm, recordings)
    if last is None:
        why = f"no server runs on this machine, and no recording in {recordings} holds a pose"
        raise ServerUnreachable("localhost", why)
    found = Where.of(arm, State.UNCONFIGURED, arm.by_joint(last.positions))
    return found, f"{last.source}; the arm may have moved since then"


def _where_lines(found: "Where", source: str) -> Sequence[str]:
    from hardware.joints import rounded

    column = max(12, *(len(name) + 1 for name in found.units))
    lines = [f"{'arm':<{column}}{found.arm}, by {source}"]
    if not found.commanded:
        return [
            *lines,
            "The pose of an inactive arm is not known; activate it: `armtree arm activate`",
        ]
    for name, q in found.commanded.items():
        unit = found.units[name]
        line = f"{name:<{column}}{rounded(q, unit):>12} commanded"
        if found.measured:
            line += f"{rounded(found.measured[name], unit):>12} measured"
        for values, digits, sign in ((found.temperature, 0, "C"), (found.voltage, 1, "V")):
            line += f"  {values[name]:.{digits}f} {sign}" if values else ""
        lines.append(line)
    if found.tool:
        lines.append(f"{'tool':<{column}}{found.tool_words}")
    if found.width_words:
        lines.append(f"{'width':<{column}}{found.width_words:>12}")
    return lines


@command()
@option("server")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def stop(server: str | None, as_json: bool) -> None:
    """Stop the arm at once, and cancel all goals.

    Without --server, stops all your arms on this machine: those of servers, and those of run, move,
    home, jog, teach, teleop and replay, which then end. If you have no arm, stops the arm of the
    server at the default port, even if another user started that server. To stop an arm of a Python
    program, press Ctrl-C there. This command is not an emergency stop: keep a switch for the power
    within reach.
    """
    from .support.server_requests import stop_all

    sys.exit(stop_all(server, as_json))
