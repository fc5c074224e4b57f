"""The jobs of a thread: all are done, in turn, though not each of them wakes it."""

import threading
from functools import partial

import pytest

from logs.writing.jobs import Jobs

PATIENCE = 20.0


def test_each_is_done_though_nothing_comes_after_it() -> None:
    jobs = Jobs("test")
    for _ in range(2_000):  # at every instant of the thread's falling asleep
        done = threading.Event()
        jobs.put_at_beat(int)
        jobs.put_at_beat(done.set)
        assert done.wait(PATIENCE)


@pytest.mark.parametrize("pause", [0.0, 0.001, 0.004])
def test_jobs_of_a_beat_and_others_are_done_in_turn(pause: float) -> None:
    jobs, done, end, nap = Jobs("test"), list[int](), threading.Event(), threading.Event()
    for number in range(100):
        put = jobs.put if number % 7 == 3 else jobs.put_at_beat
        put(partial(done.append, number))
        nap.wait(pause)
    jobs.put(end.set)
    assert end.wait(PATIENCE)
    assert done == list(range(100))
