"""The clocks: simulated time jumps only when all threads wait, and no wake-up is lost."""

import signal
import threading
import time
from collections.abc import Callable
from functools import partial

import pytest

from hardware import Clock, RealClock, SimulatedClock


def until(clock: Clock, deadline: float) -> None:
    """Waits until a time, on a new signal."""
    signal = clock.signal()
    with signal:
        while clock.now() < deadline:
            signal.wait(deadline)


@pytest.mark.parametrize("make", [RealClock, SimulatedClock])
def test_a_wait_ends_at_its_time(make: Callable[[], Clock]) -> None:
    clock = make()
    deadline = clock.now() + 0.01
    until(clock, deadline)
    assert clock.now() >= deadline


@pytest.mark.parametrize("make", [RealClock, SimulatedClock])
def test_a_notified_thread_wakes_and_a_past_time_does_not_wait(make: Callable[[], Clock]) -> None:
    clock = make()
    signal, woken = clock.signal(), list[str]()

    def wait() -> None:
        with signal:
            while not woken:
                signal.wait(None)
            woken.append("seen")

    thread = clock.spawn(wait, "waiter")
    with signal:
        signal.wait(clock.now() - 1)
        woken.append("reported")
        signal.notify()
    thread.join(5)
    assert woken == ["reported", "seen"]
    assert thread.daemon


@pytest.mark.parametrize("make", [RealClock, SimulatedClock])
def test_a_wait_that_ctrl_c_ends_leaves_the_signal_as_it_was(make: Callable[[], Clock]) -> None:
    clock = make()
    changed, waiting, raised = clock.signal(), threading.Event(), threading.Event()

    def raise_once(*_: object) -> None:
        if not raised.is_set():
            raised.set()
            raise KeyboardInterrupt

    def wait() -> None:
        with changed:
            waiting.set()
            changed.wait(None)

    def interrupt() -> None:
        waiting.wait()
        with changed:  # the other thread waits now, or is about to: then a signal does not wake it
            while not raised.wait(0.01):
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    before = signal.signal(signal.SIGINT, raise_once)
    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        wait()
    thread.join()
    signal.signal(signal.SIGINT, before)
    until(clock, clock.now() + 0.01)


def test_the_real_clock_is_monotonic_and_knows_utc() -> None:
    clock = RealClock()
    now, utc = clock.now(), time.time_ns()
    assert abs(clock.epoch_ns() + now * 1e9 - utc) < 50e6


def test_simulated_time_takes_no_time() -> None:
    clock, began = SimulatedClock(epoch_ns=7), time.monotonic()
    with clock.working():
        until(clock, 86_400.0)
    assert clock.now() == 86_400.0
    assert clock.epoch_ns() == 7
    assert time.monotonic() - began < 1


def test_time_stops_while_any_thread_works() -> None:
    clock = SimulatedClock()
    with clock.working():
        waiter = clock.spawn(lambda: until(clock, 5.0), "waiter")
        waiter.join(0.02)
        assert waiter.is_alive()
        assert clock.now() == 0.0
    waiter.join(5)
    assert clock.now() == 5.0


def test_working_within_working_still_lets_time_pass() -> None:
    clock = SimulatedClock()

    def work() -> None:
        with clock.working():
            with clock.working():
                until(clock, 1.0)
            until(clock, 2.0)

    thread = clock.spawn(work, "nested")
    thread.join(5)
    assert not thread.is_alive()
    assert clock.now() == 2.0


def test_everyone_wakes_in_the_order_of_their_deadlines() -> None:
    clock, order = SimulatedClock(), list[float]()

    def wait(deadline: float) -> None:
        until(clock, deadline)
        order.append(clock.now())

    deadlines = [0.5, 0.1, 0.3, 0.2, 0.4]
    with clock.working():
        threads = [clock.spawn(partial(wait, deadline), "waiter") for deadline in deadlines]
    for thread in threads:
        thread.join(5)
    assert order == sorted(deadlines)


def test_a_notified_thread_acts_before_time_continues() -> None:
    """A notified thread counts as working at once, although it has not run yet."""
    clock = SimulatedClock()
    signal, state = clock.signal(), {"reported": False}
    seen: list[float] = []

    def listen() -> None:
        with signal:
            while not state["reported"]:
                signal.wait(None)
            seen.append(clock.now())

    def tell() -> None:
        until(clock, 1.0)
        with signal:
            state["reported"] = True
            signal.notify()
        until(clock, 2.0)

    with clock.working():
        threads = [clock.spawn(listen, "listen"), clock.spawn(tell, "tell")]
    for thread in threads:
        thread.join(5)
    assert seen == [1.0]
    assert clock.now() == 2.0


def test_a_counted_wait_that_is_notified_and_due_at_once_is_counted_once() -> None:
    clock = SimulatedClock()
    signal = clock.signal()
    rounds = 200

    def wait() -> None:
        for k in range(1, rounds + 1):
            with signal:
                while clock.now() < k:
                    signal.wait(float(k))
                signal.notify()

    threads = [clock.spawn(wait, f"w{n}") for n in range(4)]
    for thread in threads:
        thread.join(100)
    assert not any(thread.is_alive() for thread in threads)
    assert clock.now() == rounds
    with clock.working():
        until(clock, rounds + 1.0)  # the count of working threads is 0 again
    assert clock.now() == rounds + 1


def test_no_wake_up_is_lost_between_many_threads() -> None:
    clock = SimulatedClock()
    signal = clock.signal()
    turn, players, rounds = [0], 6, 300

    def play(number: int) -> None:
        for _ in range(rounds):
            with signal:
                while turn[0] % players != number:
                    signal.wait(None)
                turn[0] += 1
                signal.notify()
            if number == 0:
                until(clock, clock.now() + 0.001)

    with clock.working():
        threads = [clock.spawn(partial(play, number), "player") for number in range(players)]
    for thread in threads:
        thread.join(100)
        assert not thread.is_alive()
    assert turn[0] == players * rounds
    assert clock.now() == pytest.approx(rounds * 0.001)
