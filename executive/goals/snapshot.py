"""How things are at one moment."""

from collections.abc import Mapping
from dataclasses import dataclass

import logs
from hardware import State

from .goal import Cause, GoalStatus
from .queue import Policy


@dataclass(frozen=True, slots=True)
class Snapshot:
    """How things are at one moment.

    Attributes:
        arm: State of the hardware.
        fault: What took the arm out of *active*, until it is activated again; None for nothing.
        port: The line to the board; empty where none was named.
        commanded: Where the arm was last commanded to, by joint [rad]; None while it is not active.
        goal: The goal under way, if there is one.
        progress: How far it is, if it has begun.
        paused: Whether the goal under way stands still.
        breakpoints: Paths of the nodes that are paused before.
        waiting: Identities of those that wait for their turn.
        policy: What becomes of a second goal.
        uptime: Since the start [s].
    """

    arm: State
    fault: Cause | None
    port: str
    commanded: Mapping[str, float] | None
    goal: GoalStatus | None
    progress: logs.Feedback | None
    paused: bool
    breakpoints: tuple[str, ...]
    waiting: tuple[str, ...]
    policy: Policy
    uptime: float
