"""Figures for Prometheus."""

from collections.abc import Callable, Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

import logs
from executive.executive import Event, Snapshot
from executive.goals.goal import GoalStatus
from hardware import State

_LATE = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5)  # [s]


class _Now(Collector):
    """What is so at the moment it is asked."""

    def __init__(self, look: Callable[[], Snapshot], watchers: Callable[[], int]) -> None:
        self._look, self._watchers = look, watchers

    def collect(self) -> Iterator[Metric]:
        """The gauges."""
        snapshot = self._look()
        arm = GaugeMetricFamily("armtree_arm_state", "1 for the arm's state.", labels=["state"])
        for state in State:
            arm.add_metric([state.value], float(state is snapshot.arm))
        yield arm
        joints = GaugeMetricFamily(
            "armtree_commanded_radians", "Where a joint was commanded to.", labels=["joint"]
        )
        for joint, position in (snapshot.commanded or {}).items():
            joints.add_metric([joint], position)
        yield joints
        running = float(snapshot.goal is not None)
        for name, words, value in (
            ("goals_running", "Goals under way.", running),
            ("goals_waiting", "Goals that wait for their turn.", float(len(snapshot.waiting))),
            ("paused", "Whether the goal under way stands still.", float(snapshot.paused)),
            ("uptime_seconds", "Since the server was started.", snapshot.uptime),
            ("watchers", "Who watches the stream of events.", float(self._watchers())),
        ):
            yield GaugeMetricFamily(f"armtree_{name}", words, value=value)


class Metrics:
    """Counts what happens.

    Args:
        look: What the executive is at.
        watchers: How many watch.
    """

    def __init__(self, look: Callable[[], Snapshot], watchers: Callable[[], int]) -> None:
        self._registry = CollectorRegistry()
        self._registry.register(_Now(look, watchers))
        self._goals = Counter(
            "armtree_goals", "Goals that ended.", ["state", "code"], registry=self._registry
        )
        self._frames = Counter(
            "armtree_frames", "Frames that were sent.", ["hold"], registry=self._registry
        )
        self._late = Histogram(
            "armtree_frame_lateness_seconds",
            "How late a frame was sent.",
            buckets=_LATE,
            registry=self._registry,
        )

    def watch(self, event: Event) -> None:
        """Count an event."""
        match event:
            case GoalStatus(outcome=outcome) if outcome:
                self._goals.labels(outcome.state.name, outcome.code).inc()
            case logs.Sent() if event.joints:
                self._frames.labels("true" if event.hold else "false").inc()
                if event.scheduled is not None:
                    self._late.observe(max(0.0, event.time - event.scheduled))

    def text(self) -> bytes:
        """All of it, in Prometheus' format."""
        return generate_latest(self._registry)
