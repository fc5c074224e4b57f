"""Metrics for Prometheus."""

from collections.abc import Callable, Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

import logs
from executive.api.events import Event, Status
from executive.api.outcome import GoalStatus
from hardware import State

_LATENESS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5)  # upper bounds of the buckets [s]


class _Gauges(Collector):
    """Gauges that are read at each request of Prometheus."""

    def __init__(self, snapshot: Callable[[], Status], subscribers: Callable[[], int]) -> None:
        self._snapshot, self._subscribers = snapshot, subscribers

    def collect(self) -> Iterator[Metric]:
        """Yield the gauges."""
        snapshot = self._snapshot()
        arm = GaugeMetricFamily("armtree_arm_state", "1 for the arm's state.", labels=["state"])
        for state in State:
            arm.add_metric([state.value], float(state is snapshot.arm))
        yield arm
        for kind, positions in (("commanded", snapshot.commanded), ("measured", snapshot.measured)):
            words = f"{kind.capitalize()} position of a joint."
            joints = GaugeMetricFamily(f"armtree_{kind}_radians", words, labels=["joint"])
            for joint, position in (positions or {}).items():
                joints.add_metric([joint], position)
            yield joints
        running = float(snapshot.goal is not None)
        for name, words, value in (
            ("goals_running", "Running goals.", running),
            ("goals_waiting", "Goals in the queue.", float(len(snapshot.waiting))),
            ("paused", "1 if the running goal is paused.", float(snapshot.paused)),
            ("uptime_seconds", "Time since the server started.", snapshot.uptime),
            ("watchers", "Clients that watch the event stream.", float(self._subscribers())),
        ):
            yield GaugeMetricFamily(f"armtree_{name}", words, value=value)


class Metrics:
    """Counts events.

    Args:
        snapshot: Callback that returns the state of the executive.
        subscribers: Callback that returns the number of clients of the event stream.
    """

    def __init__(self, snapshot: Callable[[], Status], subscribers: Callable[[], int]) -> None:
        self._registry = CollectorRegistry()
        self._registry.register(_Gauges(snapshot, subscribers))
        self._goals = Counter(
            "armtree_goals", "Goals that ended.", ["state", "code"], registry=self._registry
        )
        self._frames = Counter(
            "armtree_frames", "Frames that were sent.", ["hold"], registry=self._registry
        )
        self._lost = Gauge(
            "armtree_lost_answers",
            "Lost answers of a servo since the port was opened.",
            ["joint"],
            registry=self._registry,
        )
        self._lateness = Histogram(
            "armtree_frame_lateness_seconds",
            "Delay of a frame after its scheduled time.",
            buckets=_LATENESS,
            registry=self._registry,
        )

    def count(self, event: Event) -> None:
        """Count an event."""
        match event:
            case GoalStatus(outcome=outcome) if outcome:
                self._goals.labels(outcome.state.name, outcome.code).inc()
            case logs.Sent() if event.joints:
                self._frames.labels("true" if event.hold else "false").inc()
                if event.scheduled is not None:
                    self._lateness.observe(max(0.0, event.time - event.scheduled))
            case logs.Measured():
                for joint, lost in zip(event.joints, event.lost, strict=False):
                    self._lost.labels(joint).set(lost)

    def text(self) -> bytes:
        """Return all metrics in Prometheus' text format."""
        return generate_latest(self._registry)
