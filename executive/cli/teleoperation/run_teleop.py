"""Makes an arm of this command follow a leader, an arm that a person moves by hand."""

import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from executive.api import token_file
from executive.api.codes import INTERRUPTED_EXIT, OK
from executive.api.move import LEADER, Move
from executive.cli.jogging.arms import OwnArm
from executive.cli.jogging.run_jog import pose_words
from executive.cli.support.failures import Refusal
from executive.cli.support.interrupts import Interrupts
from executive.cli.support.log_handler import recorded_log
from executive.cli.support.own_arms import stoppable
from executive.cli.support.process import make_punctual
from executive.cli.support.run_tasks import perhaps_meant, with_holder
from executive.cli.support.server_requests import holds
from executive.cli.terminal.keyboard import key_by_key
from executive.cli.terminal.streams import echo
from executive.client.synchronous import Client
from executive.code_table import exit_status
from executive.errors import ClientError
from executive.session import open_executive, port_line
from executive.setup import Setup
from executive.task_runner import TaskRunner
from hardware import Robot, load_robot

from .screen import TeleopScreen
from .servo_leader import HandGuidedArm


def run_teleop(
    port: str, leader_robot: Path | None, speed: float, options: Mapping[str, Any]
) -> int:
    """Make an arm follow a leader. When a key or a signal ends this, print the arm's position.

    The following arm is activated first. The leader loses its torque later.

    Args:
        port: Port of the leader.
        leader_robot: Robot file of the leader; None for the robot file of the arm.
        speed: Share of the robot's speed.
        options: Values for fields of a `Setup`, by name.

    Returns:
        The exit status.

    Raises:
        Refusal: There is no terminal, the leader has other joints, or a server has the arm.
        HardwareError: The leader cannot be opened, or cannot measure or switch its torque.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise Refusal("teleoperation needs a terminal, because it shows a screen and reads keys")
    make_punctual()
    setup = Setup(**options, single_user=True)
    robot = setup.load_robot()
    leading = load_robot(leader_robot) if leader_robot else robot
    joints, led = ([joint.name for joint in each.actuated] for each in (robot, leading))
    if joints != led:
        raise Refusal(
            f"the joints of the leader ({', '.join(led)}) differ from those of {robot.name} "
            f"({', '.join(joints)})"
        )
    _check_servers(setup, robot)
    leader = HandGuidedArm(leading, leading.link(port))
    with (
        Interrupts() as interrupts,
        stoppable(echo),
        key_by_key() as keys,
        open_executive(setup, leader=leader, report=echo) as executive,
        recorded_log(executive),
    ):
        assert keys is not None
        executive.start()
        runner = TaskRunner(executive)
        interrupts.on_cancel(runner.stop)
        # The leader does not lead yet, so this goal ends as soon as the arm is active.
        outcome = interrupts.run(lambda: runner.run(Move((LEADER,))))
        if outcome.code != OK:
            echo(with_holder(outcome, executive.port, _server_words).text())
            return exit_status(outcome.code)
        try:
            leader.open()
            screen = TeleopScreen(OwnArm(executive), robot.actuated, leader, speed)
            interrupts.on_cancel(screen.leave)
            where = interrupts.run(lambda: screen.run(keys))
        finally:
            held = leader.close()
        echo(port_line(executive))
        echo(f"The arm holds at {pose_words(where)}")
        echo(f"The leader {'holds its position' if held else 'has no torque: hold it'}")
    return INTERRUPTED_EXIT if screen.left else 0


def _check_servers(setup: Setup, robot: Robot) -> None:
    """Check that no server has the robot, if no port is given and the arm would be virtual.

    Raises:
        Refusal: A server has the robot, so the user may mean the arm of that server.
    """
    for server in perhaps_meant(robot.serial.port if setup.port is None else setup.port):
        with suppress(ClientError), Client(server.url) as client:
            if holds(client.robot(), robot):
                words = "To have a virtual arm follow instead, add --port virtual"
                raise Refusal(f"{_server_words(server)}. {words}")


def _server_words(server: token_file.ServerInfo) -> str:
    """Return a message that a server has the arm, with the command to release its port."""
    return (
        f"the armtree server {server.url} has the arm, and cannot follow a leader. Run "
        f"`armtree arm deactivate --server {server.url}` to release its port, then give that port "
        "with --port"
    )
