"""Runs a jog on an arm of this command, or on a server."""

import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import click

from executive.api.codes import INTERRUPTED_EXIT
from executive.api.events import EVENTS, STATUS, Event, Where
from executive.api.move import Move
from executive.api.outcome import Cause, GoalState, GoalStatus, Outcome
from executive.cli.support.failures import Refusal
from executive.cli.support.interrupts import Interrupts
from executive.cli.support.log_handler import recorded_log
from executive.cli.support.process import raise_priority
from executive.cli.terminal.keyboard import key_by_key
from executive.cli.terminal.streams import echo
from executive.client.synchronous import Client
from executive.errors import Refused, ServerUnreachable
from executive.executive import Executive
from executive.session import open_executive, port_line
from executive.setup import Setup
from executive.task_runner import TaskRunner
from hardware import HardwareError, NotActive
from logs import MOVE, Measured, Sent, Transition
from trees import TreeError

from .model import Command
from .screen import Act, JogArm, JogScreen

# Errors of a key's command that do not end the jog.
_SHOWN = (HardwareError, TreeError, click.ClickException)
# Events after which the arm has moved or changed its state. The end of a motion is one of them,
# because its last setpoints may not change the frame.
_CHANGES = (Sent, Transition, GoalStatus)
_KINDS = (STATUS, EVENTS[Sent], EVENTS[Transition])


class OwnArm:
    """An arm of this command.

    Attributes:
        by_hand: True while its servos have no torque.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive, self._runner, self.by_hand = executive, TaskRunner(executive), False
        self._path: list[Mapping[str, float]] | None = None

    def move(self, move: Move, accepted: Callable[[], None]) -> Outcome:
        """Move, and wait for the end."""
        return self._runner.run(move, accepted=accepted)

    def stop(self) -> None:
        """Stop the arm at once."""
        self._executive.cancel()

    def where(self) -> Where:
        """Return the position of the arm. It is measured while a person moves the arm.

        Raises:
            NotActive: The arm failed while a person moved it. Only the next call raises this.
        """
        where = self._executive.where()
        if not self.by_hand:
            return where
        if not where.measured:
            self.by_hand, fault = False, self.fault()
            raise NotActive(f"The arm has no torque: hold it. {fault.message if fault else ''}")
        there = Where.of(self._executive.robot, where.arm, where.measured)
        return replace(there, measured=where.measured)

    def fault(self) -> Cause | None:
        """Return the fault that took the arm out of *active*; None after the next activation."""
        return self._executive.status().fault

    def watch(self, changed: Callable[[], None]) -> None:
        """Call a function at every change."""

        def note(event: Event) -> None:
            by_hand = self.by_hand and isinstance(event, Measured)
            if by_hand and isinstance(event, Measured) and self._path is not None:
                self._path.append(dict(zip(event.joints, event.position, strict=True)))
            if by_hand or isinstance(event, _CHANGES):
                changed()

        self._executive.subscribe(note)

    def switch_torque(self, on: bool) -> None:
        """Switch the torque of the servos, so that a person may move the arm."""
        self._executive.switch_torque(on)
        self.by_hand, self._path = not on, None

    def start_path(self) -> None:
        """Start to store measurements."""
        self._path = [self.where().measured or {}]

    def end_path(self) -> Sequence[Mapping[str, float]]:
        """Return the measurements since the start of the path."""
        path, self._path = self._path, None
        return path or ()


class _ServerArm:
    """The arm of a server. No person moves it by hand."""

    by_hand = False

    def __init__(self, client: Client) -> None:
        self._client = client

    def move(self, move: Move, accepted: Callable[[], None]) -> Outcome:
        """Move, and wait for the end."""
        try:
            goal_id = self._client.send_move(move)
        except Refused as error:
            return Outcome.of(MOVE, GoalState.ABORTED, error.cause)
        accepted()
        return self._client.result(goal_id)

    def stop(self) -> None:
        """Stop the arm at once."""
        self._client.stop()

    def where(self) -> Where:
        """Return the position of the arm."""
        return self._client.where()

    def watch(self, changed: Callable[[], None]) -> None:
        """Call a function at every change, until the server ends."""
        with self._client.events(*_KINDS) as events:
            for _ in events:
                changed()
        raise ServerUnreachable(self._client.url, "it has ended")


def run_jog(
    server: str | None,
    options: Mapping[str, Any],
    speed: float,
    commands: Callable[[JogArm], Mapping[str, tuple[Command, Act]]],
    title: str = "armtree jog",
    steps: Callable[[], Sequence[str]] | None = None,
) -> int:
    """Jog an arm until a key or a signal ends it. Then print its position.

    Args:
        server: URL of the server; None for an arm of this command.
        options: Fields of a `Setup`.
        speed: Share of the robot's speed.
        commands: Callback that returns further commands for the arm with their functions, by key.
        title: Title of the screen.
        steps: Callback that returns the taken steps, for people; None for a jog without steps.

    Returns:
        The exit status.

    Raises:
        Refusal: There is no terminal.
        ClientError: The server is gone.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise Refusal("a jog needs a terminal; `armtree move --by joint_1=5deg` does not need one")
    raise_priority()
    # The shell must not get keys that are typed while the arm stops and the recording is closed.
    with (
        Interrupts() as interrupts,
        key_by_key() as keys,
        _arm(server, options) as (port, arm, note),
    ):
        assert keys is not None
        screen = JogScreen(arm, commands(arm), speed, note, title, steps, _SHOWN)
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
    """Open the arm. Yield its name in words, the arm, and the first message."""
    if server:
        with Client(server) as client:
            note = (
                "" if client.where().commanded else "Activate the arm first: armtree arm activate"
            )
            yield f"Server {client.url}", _ServerArm(client), note
        return
    setup = Setup(**options, reload=True, single_user=True)
    with open_executive(setup, report=echo) as executive, recorded_log(executive):
        executive.start()
        effect, arm = executive.robot.open_effect, OwnArm(executive)
        yield port_line(executive), arm, f"The first step opens the port; the arm {effect}"


def _hold(arm: JogArm) -> str:
    """Hold a hand-guided arm at its position. Return the error, or ""."""
    if isinstance(arm, OwnArm) and arm.by_hand:
        try:
            arm.switch_torque(on=True)
        except HardwareError as error:
            return f"The arm has no torque: hold it. {error}"
    return ""


def pose_words(where: Where) -> str:
    """Return the pose that an arm holds, for people."""
    if not where.commanded:
        return "an unknown position: it was never active"
    return where.words(where.commanded)
