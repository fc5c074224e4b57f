"""Delivery of events: each once, in order, and without deadlocks."""

import threading
from collections.abc import Callable

import pytest

from hardware import ArmEvent, CommandSent
from hardware.arm.events import Outbox

FIRST, SECOND, THIRD = (CommandSent(time, b"") for time in (1.0, 2.0, 3.0))


class Watch:
    """Records events, and acts at the first one."""

    def __init__(self) -> None:
        self.reported: list[ArmEvent] = []
        self.first: Callable[[], None] = lambda: None

    def __call__(self, event: ArmEvent) -> None:
        self.reported.append(event)
        first, self.first = self.first, lambda: None
        first()


class Held:
    """An outbox with an observer that is processing the first event in another thread."""

    def __init__(self) -> None:
        self.watch = Watch()
        self.outbox = Outbox(self.watch)
        self.entered, self.leave = threading.Event(), threading.Event()
        self.watch.first = self.stay
        self.outbox.put(FIRST)
        self.thread = threading.Thread(target=self.outbox.deliver, daemon=True)
        self.thread.start()
        assert self.entered.wait(5)

    def stay(self) -> None:
        self.entered.set()
        assert self.leave.wait(5)

    def end(self) -> list[ArmEvent]:
        self.leave.set()
        self.thread.join(5)
        assert not self.thread.is_alive()
        return self.watch.reported


def test_events_are_delivered_in_order() -> None:
    watch = Watch()
    outbox = Outbox(watch)
    outbox.deliver()
    outbox.put(FIRST)
    outbox.put(SECOND)
    assert watch.reported == []
    outbox.deliver()
    outbox.deliver()
    assert watch.reported == [FIRST, SECOND]


def test_a_thread_leaves_its_events_to_the_one_that_delivers() -> None:
    held = Held()
    held.outbox.put(SECOND)
    held.outbox.deliver()
    assert held.watch.reported == [FIRST]
    assert held.end() == [FIRST, SECOND]


def test_a_delivery_with_a_timeout_waits_until_all_is_delivered() -> None:
    held = Held()
    held.outbox.put(SECOND)
    patient = threading.Thread(target=held.outbox.deliver, args=(5.0,))
    patient.start()
    patient.join(0.02)
    assert patient.is_alive()
    held.end()
    patient.join(5)
    assert not patient.is_alive()
    assert held.watch.reported == [FIRST, SECOND]


def test_the_timeout_of_a_delivery_ends() -> None:
    held = Held()
    held.outbox.deliver(0.01)
    assert held.end() == [FIRST]


def test_an_observer_may_bring_about_the_next_event() -> None:
    watch = Watch()
    outbox = Outbox(watch)

    def go_on() -> None:
        outbox.put(THIRD)
        outbox.deliver()

    watch.first = go_on
    outbox.put(FIRST)
    outbox.put(SECOND)
    outbox.deliver()
    assert watch.reported == [FIRST, SECOND, THIRD]


def test_an_observer_that_fails_does_not_keep_the_next_event() -> None:
    watch = Watch()
    outbox = Outbox(watch)

    def fail() -> None:
        raise RuntimeError("a bug of the one who watches")

    watch.first = fail
    outbox.put(FIRST)
    with pytest.raises(RuntimeError):
        outbox.deliver()
    outbox.put(SECOND)
    outbox.deliver()
    assert watch.reported == [FIRST, SECOND]


def test_events_of_many_threads_are_delivered_once_and_in_the_order_of_each_thread() -> None:
    watch = Watch()
    outbox = Outbox(watch)

    def put(number: int) -> None:
        for count in range(500):
            outbox.put(CommandSent(count, b"%d" % number))
            outbox.deliver()

    threads = [threading.Thread(target=put, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    events = [event for event in watch.reported if isinstance(event, CommandSent)]
    for number in range(4):
        times = [event.time for event in events if event.data == b"%d" % number]
        assert times == list(range(500))
