"""Runs a jog on an arm of this command, or on a server."""

import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from executive.api.codes import INTERRUPTED_EXIT
from executive.api.events import Where
from executive.cli.support.failures import Refusal
from executive.cli.support.interrupts import Interrupts
from executive.cli.support.log_handler import recorded_log
from executive.cli.support.own_arms import stoppable
from executive.cli.support.process import make_punctual
from executive.cli.terminal.keyboard import key_by_key
from executive.cli.terminal.streams import echo
from executive.client.synchronous import Client
from executive.session import open_executive, port_line
from executive.setup import Setup
from hardware import HardwareError

from .arms import JogArm, OwnArm, ServerArm
from .model import KeyCommand
from .screen import Act, JogScreen


def run_jog(
    server: str | None,
    options: Mapping[str, Any],
    speed: float,
    commands: Callable[[JogArm], Mapping[str, tuple[KeyCommand, Act]]],
    title: str = "armtree jog",
    steps: Callable[[], Sequence[str]] | None = None,
) -> int:
    """Jog an arm until a key or a signal ends the jog. Then print the position of the arm.

    Args:
        server: URL of the server; None for an arm of this command.
        options: Values for fields of a `Setup`, by name.
        speed: Share of the robot's speed, 0.01 to 1.
        commands: Callback that gets the arm. It returns the commands that do not move the arm, by
            key, each with its function.
        title: Title of the screen.
        steps: Callback that returns the steps of the taught task as texts; None to show no steps.

    Returns:
        The exit status.

    Raises:
        Refusal: There is no terminal.
        ClientError: The server is gone.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise Refusal("a jog needs a terminal; `armtree move --by joint_1=5deg` does not need one")
    make_punctual()
    # The shell must not get keys that are typed while the arm stops and the recording is closed.
    with (
        Interrupts() as interrupts,
        key_by_key() as keys,
        _arm(server, options) as (port, arm, note),
    ):
        assert keys is not None
        screen = JogScreen(arm, commands(arm), speed, note, title, steps)
        interrupts.on_cancel(screen.leave)
        before = signal.signal(signal.SIGWINCH, lambda *_: screen.wake())
        try:
            interrupts.run(lambda: screen.run(keys))
        finally:
            signal.signal(signal.SIGWINCH, before)
            why = _hold(arm)
        echo(port)
        echo(why or f"The arm holds at {pose_words(arm.where())}")
    return INTERRUPTED_EXIT if screen.left else 0


@contextmanager
def _arm(server: str | None, options: Mapping[str, Any]) -> Iterator[tuple[str, JogArm, str]]:
    """Open the arm. Yield a line with its server or port, the arm, and the first message."""
    if server:
        with Client(server) as client:
            note = "Activate the arm first: armtree arm activate"
            note = "" if client.where().commanded else note
            yield f"Server {client.url}", ServerArm(client), note
        return
    setup = Setup(**options, reload=True, single_user=True)
    with (
        stoppable(echo),
        open_executive(setup, report=echo) as executive,
        recorded_log(executive),
    ):
        executive.start()
        effect, arm = executive.robot.open_effect, OwnArm(executive)
        yield port_line(executive), arm, f"The first step opens the port; the arm {effect}"


def _hold(arm: JogArm) -> str:
    """Switch the torque on, if the arm is moved by hand. Return an error for people, or ""."""
    if isinstance(arm, OwnArm) and arm.by_hand:
        try:
            arm.switch_torque(on=True)
        except HardwareError as error:
            fault = arm.fault()
            return f"The arm has no torque: hold it. {fault.message if fault else error}"
    return ""


def pose_words(where: Where) -> str:
    """Return the pose that an arm holds, for people."""
    if not where.commanded:
        return "an unknown position: the arm is not active"
    return where.words(where.commanded)
