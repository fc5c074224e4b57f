"""The state of a run for the live view, from its events."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import logs
from executive.api.events import Where
from executive.api.outcome import Outcome
from hardware.printable import printable


@dataclass(slots=True)
class RunState:
    """The state of a run at one moment. Times are on the clock of the events [s].

    Attributes:
        where: State of the arm before the run: its joints, and the boot time of its board.
        goal_id: Identity of the goal.
        title: Number and name of the task.
        has_nodes: False for a move. Its nodes are not shown, because its outcome describes them.
        arm: State of the arm's lifecycle.
        activated: Start of the activation; None if the arm is not activating.
        began: Start of the goal; None before the start.
        ended: End of the goal; None before the end.
        percentage: Share of executed frames [%]; None if unknown.
        phase: Phase of the goal.
        nodes: The nodes of the tree by path, parents first.
        positions: Commanded position by joint [rad].
        measured: Measured position by joint [rad]; empty if not measured.
        targets: Position at the end of the current motion by joint [rad].
        motion_end: End of the current motion; None if nothing moves.
    """

    where: Where = field(default_factory=Where)
    goal_id: str = ""
    title: str = ""
    has_nodes: bool = True
    arm: str = "unconfigured"
    activated: float | None = None
    began: float | None = None
    ended: float | None = None
    percentage: int | None = None
    phase: str = ""
    nodes: dict[str, logs.NodeStatus] = field(default_factory=dict)
    positions: Mapping[str, float] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)
    targets: Mapping[str, float] = field(default_factory=dict)
    motion_end: float | None = None
    _due: tuple[float, ...] = ()
    _sent: int = 0

    def begun(self, goal: logs.Goal) -> "RunState":
        """Return the state at the start of the next goal of the same arm."""
        title = printable(logs.goal_title(goal.task, goal.name))
        return RunState(
            self.where,
            goal.goal_id,
            title,
            goal.task != logs.MOVE,
            self.arm,
            self.activated,
            goal.time,
            positions=self.positions,
            measured=self.measured,
        )

    def update(self, record: logs.Record) -> None:
        """Update the state with an event of the run."""
        match record:
            case logs.NodeStatus() if self.has_nodes:
                self._node(record)
            case logs.Feedback():
                self.percentage, self.phase = record.percentage, printable(record.phase)
            case logs.Plan():
                self.positions = self.positions or record.start
            case logs.Schedule():
                self._schedule(record)
            case logs.Sent() if record.joints:
                self._frame(record)
            case logs.Measured():
                self.measured = dict(zip(record.joints, record.position, strict=True))
            case logs.Transition():
                self.arm = printable(record.goal)
                self.activated = record.time if record.goal == "activating" else None
            case logs.Result():
                self.end(record.time, record.state)

    def end(self, time: float, state: str) -> None:
        """Update the state with the end of the run, such as `CANCELED`."""
        self.ended = self.ended or time
        self.phase, self.motion_end = state.lower(), None
        self.percentage = 100 if state == "SUCCEEDED" else self.percentage

    def _node(self, record: logs.NodeStatus) -> None:
        before = self.nodes[record.path].status if record.path in self.nodes else ""
        status = logs.shown_status(record.status, before)
        name, message = printable(record.name), printable(record.message)
        self.nodes[record.path] = replace(record, status=status, name=name, message=message)

    def _schedule(self, record: logs.Schedule) -> None:
        self.positions = record.start
        last = record.samples[-1] if record.samples else tuple(record.start.values())
        self.targets = dict(zip(record.start, last, strict=True))
        self._due, self._sent = record.times, 0
        self.motion_end = record.time + record.times[-1] if record.times else None
        self._finish()

    def _frame(self, record: logs.Sent) -> None:
        self.positions = dict(zip(record.joints, record.positions, strict=True))
        if record.hold or record.scheduled is None or self._sent >= len(self._due):
            self.motion_end = None
            return
        self.motion_end = record.scheduled + self._due[-1] - self._due[self._sent]
        self._sent += 1
        self._finish()

    def _finish(self) -> None:
        """After the last frame, set the positions to the end of the motion."""
        if self._sent == len(self._due):
            self.positions = self.targets

    def stopped(self, outcome: Outcome) -> str:
        """Return a line with the pose in which a failed goal stopped; empty if it sent no frame."""
        if outcome.success or not outcome.frames or not self.positions:
            return ""
        sent, due = self._sent, len(self._due)
        done = f", after {sent} of {due} frames of its motion" if sent < due else ""
        return printable(f"  stopped at {self.where.words(self.positions)}{done}")
