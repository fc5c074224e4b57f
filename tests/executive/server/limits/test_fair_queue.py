"""Turns: in order, one at a time, and with a rest in proportion to the work."""

import asyncio
from collections.abc import Callable
from typing import Any, cast

import pytest

from executive.server.limits.fair_queue import MAX_DEBT, REST_FACTOR, FairQueue


class Loop:
    """A loop whose time is told."""

    def __init__(self) -> None:
        self.soon: list[Callable[[], None]] = []
        self.later: list[tuple[float, Callable[[], None]]] = []
        self.now = 10.0

    def time(self) -> float:
        return self.now

    def call_soon(self, act: Callable[..., None], *given: Any) -> None:
        self.soon.append(lambda: act(*given))

    def call_later(self, delay: float, act: Callable[[], None]) -> None:
        self.later.append((delay, act))

    def go_on(self) -> float:
        """Do what is to be done soon, then the one thing that is to be done later."""
        for act in [self.soon.pop(0) for _ in self.soon]:
            act()
        ((delay, act),) = [self.later.pop(0) for _ in self.later]
        self.now += delay
        act()
        return delay


class Rig:
    """Turns for connections that note what is let in, each piece for some work."""

    def __init__(self, work: float = 0.0) -> None:
        self.loop, self.work, self.worked = Loop(), work, 0.0
        self.queue = FairQueue(cast(asyncio.AbstractEventLoop, self.loop), lambda: self.worked)
        self.let_in: list[str] = []

    def connection(self, name: str) -> "Connection":
        return Connection(self, name)


class Connection:
    """Notes what is let in."""

    def __init__(self, rig: Rig, name: str) -> None:
        self.rig, self.name = rig, name

    def send(self, *pieces: str, priority: bool = False) -> None:
        for piece in pieces:
            self.rig.queue.put(self, piece.encode(), priority)

    def process(self, data: bytes) -> None:
        self.rig.worked += self.rig.work
        self.rig.let_in.append(f"{self.name}{data.decode()}")


def test_one_piece_at_a_time_of_each_by_turns() -> None:
    rig = Rig()
    a, b = rig.connection("a"), rig.connection("b")
    a.send("1", "2", "3")
    b.send("1", "2")
    assert rig.let_in == ["a1"]
    for _ in range(4):
        rig.loop.go_on()
    assert rig.let_in == ["a1", "a2", "b1", "a3", "b2"]


def test_who_is_first_waits_for_one_turn_and_takes_none_from_the_others() -> None:
    rig = Rig()
    others = [rig.connection(name) for name in "abcd"]
    for each in others:
        each.send("1")
    first = rig.connection("x")
    first.send("1", "2", "3", priority=True)
    for _ in range(6):
        rig.loop.go_on()
    assert rig.let_in[0] == "a1"
    assert "x1" in rig.let_in[1:3]
    assert sorted(rig.let_in) == ["a1", "b1", "c1", "d1", "x1", "x2", "x3"]
    assert rig.let_in.index("b1") < rig.let_in.index("x2")


def test_a_rest_is_as_long_as_the_work_wants_it() -> None:
    rig = Rig(work=0.25)
    a = rig.connection("a")
    a.send("1", "2")
    assert rig.loop.go_on() == pytest.approx(REST_FACTOR * 0.25 - MAX_DEBT)
    assert rig.let_in == ["a1", "a2"]
    a.send("3")
    assert rig.let_in == ["a1", "a2"]  # it still rests
    assert rig.loop.go_on() == pytest.approx(REST_FACTOR * 0.25)


def test_a_little_work_is_rested_from_later() -> None:
    work = MAX_DEBT / REST_FACTOR / 4
    rig = Rig(work)
    a = rig.connection("a")
    a.send(*"12345678")
    rests = [rig.loop.go_on() for _ in range(7)]
    assert rests[:4] == pytest.approx([0.0] * 4)
    assert sum(rests) == pytest.approx(7 * work * REST_FACTOR - MAX_DEBT)


def test_what_comes_after_a_rest_is_let_in_at_once() -> None:
    rig = Rig(work=0.25)
    rig.connection("a").send("1")
    rig.loop.go_on()
    rig.connection("b").send("1")
    assert rig.let_in == ["a1", "b1"]


def test_who_has_left_has_no_turn() -> None:
    rig = Rig()
    a, b = rig.connection("a"), rig.connection("b")
    a.send("1", "2")
    b.send("1")
    assert rig.queue.has(a)
    rig.queue.remove(a)
    assert not rig.queue.has(a)
    rig.loop.go_on()
    assert rig.let_in == ["a1", "b1"]
