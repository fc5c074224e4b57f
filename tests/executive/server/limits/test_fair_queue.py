"""The fair queue: round robin, one piece at a time, and a rest in proportion to the work."""

import asyncio
from collections.abc import Callable
from typing import Any, cast

import pytest

from executive.server.limits.fair_queue import MAX_BUSY_REST, MAX_DEBT, REST_FACTOR, FairQueue


class Loop:
    """An event loop with simulated time."""

    def __init__(self) -> None:
        self.soon: list[Callable[[], None]] = []
        self.later: list[tuple[float, Callable[[], None]]] = []
        self.now, self.step = 10.0, 0.0

    def time(self) -> float:
        return self.now

    def call_soon(self, act: Callable[..., None], *given: Any) -> None:
        self.soon.append(lambda: act(*given))

    def call_later(self, delay: float, act: Callable[[], None]) -> None:
        self.later.append((delay, act))

    def advance(self) -> float:
        """Run the pending callbacks, then the only delayed one; return its delay [s]."""
        for act in [self.soon.pop(0) for _ in self.soon]:
            self.now += self.step  # how long the work took
            act()
        ((delay, act),) = [self.later.pop(0) for _ in self.later]
        self.now += delay
        act()
        return delay


class Rig:
    """A queue and its connections; processing a piece takes `work` [s]."""

    def __init__(self, work: float = 0.0) -> None:
        self.loop, self.work, self.worked = Loop(), work, 0.0
        self.queue = FairQueue(cast(asyncio.AbstractEventLoop, self.loop), lambda: self.worked)
        self.processed: list[str] = []

    def connection(self, name: str) -> "Connection":
        return Connection(self, name)


class Connection:
    """Notes what it processes."""

    def __init__(self, rig: Rig, name: str) -> None:
        self.rig, self.name = rig, name

    def send(self, *pieces: str, priority: bool = False) -> None:
        for piece in pieces:
            self.rig.queue.put(self, piece.encode(), priority)

    def process(self, data: bytes) -> None:
        self.rig.worked += self.rig.work
        self.rig.processed.append(f"{self.name}{data.decode()}")


def test_connections_are_served_round_robin() -> None:
    rig = Rig()
    a, b = rig.connection("a"), rig.connection("b")
    a.send("1", "2", "3")
    b.send("1", "2")
    assert rig.processed == ["a1"]
    for _ in range(4):
        rig.loop.advance()
    assert rig.processed == ["a1", "a2", "b1", "a3", "b2"]


def test_the_priority_line_gets_every_second_turn() -> None:
    rig = Rig()
    others = [rig.connection(name) for name in "abcd"]
    for each in others:
        each.send("1")
    first = rig.connection("x")
    first.send("1", "2", "3", priority=True)
    for _ in range(6):
        rig.loop.advance()
    assert rig.processed[0] == "a1"
    assert "x1" in rig.processed[1:3]
    assert sorted(rig.processed) == ["a1", "b1", "c1", "d1", "x1", "x2", "x3"]
    assert rig.processed.index("b1") < rig.processed.index("x2")


def test_a_rest_is_in_proportion_to_the_work() -> None:
    rig = Rig(work=0.25)
    a = rig.connection("a")
    a.send("1", "2")
    assert rig.loop.advance() == pytest.approx(REST_FACTOR * 0.25 - MAX_DEBT)
    assert rig.processed == ["a1", "a2"]
    a.send("3")
    assert rig.processed == ["a1", "a2"]  # the queue still rests
    assert rig.loop.advance() == pytest.approx(REST_FACTOR * 0.25)


def test_it_rests_longer_if_others_had_the_processor_meanwhile() -> None:
    rig = Rig(work=0.25)
    rig.loop.step = 0.251
    rig.connection("a").send("1")
    assert rig.loop.advance() == pytest.approx(REST_FACTOR * 0.25 - MAX_DEBT + 0.01)
    rig.loop.step = 7.0
    rig.connection("b").send("1")
    assert rig.loop.advance() == pytest.approx(REST_FACTOR * 0.25 - MAX_DEBT + MAX_BUSY_REST)


def test_the_rest_after_little_work_is_postponed() -> None:
    work = MAX_DEBT / REST_FACTOR / 4
    rig = Rig(work)
    a = rig.connection("a")
    a.send(*"12345678")
    rests = [rig.loop.advance() for _ in range(7)]
    assert rests[:4] == pytest.approx([0.0] * 4)
    assert sum(rests) == pytest.approx(7 * work * REST_FACTOR - MAX_DEBT)


def test_data_after_a_rest_is_processed_at_once() -> None:
    rig = Rig(work=0.25)
    rig.connection("a").send("1")
    rig.loop.advance()
    rig.connection("b").send("1")
    assert rig.processed == ["a1", "b1"]


def test_data_of_a_closed_connection_is_dropped() -> None:
    rig = Rig()
    a, b = rig.connection("a"), rig.connection("b")
    a.send("1", "2")
    b.send("1")
    assert rig.queue.has(a)
    rig.queue.remove(a)
    assert not rig.queue.has(a)
    rig.loop.advance()
    assert rig.processed == ["a1", "b1"]
