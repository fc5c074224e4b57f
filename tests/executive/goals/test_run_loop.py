"""The mailbox of a run, and the paths of nodes."""

import threading

import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.composites import Sequence

from executive.goals.mailbox import Mailbox
from executive.goals.stop import STOP_TIMEOUT
from hardware import RealClock, SimulatedClock
from trees.compile.node_paths import paths


@pytest.fixture
def clock() -> SimulatedClock:
    return SimulatedClock()


def test_an_earlier_post_needs_no_wait(clock: SimulatedClock) -> None:
    mailbox = Mailbox(clock)
    mailbox.wake()
    mailbox.wake()
    mailbox.wait()
    mailbox.cancel()
    mailbox.wait()
    mailbox.wait()
    assert mailbox.canceled


def test_a_wake_is_taken_once() -> None:
    mailbox, woken = Mailbox(RealClock()), threading.Event()
    mailbox.wake()
    mailbox.wait()

    def wait() -> None:
        mailbox.wait()
        woken.set()

    thread = threading.Thread(target=wait)
    thread.start()
    assert not woken.is_set()
    mailbox.wake()
    thread.join(5)
    assert woken.is_set()


@pytest.mark.parametrize("post", ["wake", "cancel", "fail"])
def test_posting_wakes_from_another_thread(clock: SimulatedClock, post: str) -> None:
    mailbox = Mailbox(clock)
    arguments = [OSError("x")] if post == "fail" else []
    with clock.working():
        clock.spawn(lambda: getattr(mailbox, post)(*arguments), "poster")
        mailbox.wait()
    assert mailbox.canceled == (post == "cancel")
    assert (mailbox.fault is not None) == (post == "fail")


def test_the_first_fault_counts(clock: SimulatedClock) -> None:
    mailbox, first = Mailbox(clock), OSError("first")
    mailbox.fail(first)
    mailbox.fail(OSError("second"))
    assert mailbox.fault is first


def test_wait_until_it_is_so(clock: SimulatedClock) -> None:
    mailbox, so = Mailbox(clock), threading.Event()

    def later() -> None:
        signal = clock.signal()
        with signal:
            signal.wait(0.1)
        so.set()
        mailbox.wake()

    with clock.working():
        clock.spawn(later, "later")
        assert mailbox.wait_until(so.is_set, STOP_TIMEOUT)
    assert clock.now() == pytest.approx(0.1)


def test_wait_until_the_time_is_up(clock: SimulatedClock) -> None:
    mailbox = Mailbox(clock)
    with clock.working():
        assert not mailbox.wait_until(lambda: False, STOP_TIMEOUT)
    assert clock.now() == pytest.approx(STOP_TIMEOUT)


def named(name: str, *children: Behaviour) -> Behaviour:
    return Sequence(name, memory=True, children=list(children)) if children else Dummy(name)


def test_every_node_has_a_path_of_its_own() -> None:
    root = named("t", named("a", named("x"), named("x")), named("a", named("x")), named("b"))
    assert [path for _, path in paths(root)] == [
        "t",
        "t/a",
        "t/a/x",
        "t/a/1:x",
        "t/1:a",
        "t/1:a/x",
        "t/b",
    ]


def test_parents_come_before_their_children() -> None:
    root = named("t", named("t", named("t"), named("t")), named("t"))
    found = [path for _, path in paths(root)]
    assert len(set(found)) == len(found)
    for path in found[1:]:
        assert path.rpartition("/")[0] in found[: found.index(path)]
