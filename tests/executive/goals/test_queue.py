"""The queue of goals, compared with the answers of a real action server."""

import math
import threading
from pathlib import Path

import pytest

from executive.api import Policy
from executive.api.outcome import Acceptance, CancelCode, GoalState, Outcome
from executive.errors import ResultTimeout, UnknownGoal
from executive.goals.queue import KEPT, WAITING
from tests.conftest import RigMaker
from tests.support.generated.goals_table import Table
from tests.support.servers.server_acts import at_frame

S, C = GoalState, CancelCode
UNKNOWN_ID = "0" * 32
UNKNOWN = "f" * 32


# What a real server (rclpy) answers, one after the other


def test_a_short_goal() -> None:
    table = Table()
    answer = table.send("a" * 32)
    assert answer.accepted
    assert answer.stamp_ns == table.clock.epoch_ns()
    table.begin()
    table.end(S.SUCCEEDED)
    assert table.goals.result("a" * 32, None).state.value == 4
    assert table.history["a" * 32] == [1, 2, 4]


def test_the_same_name_again_is_refused_also_after_the_end() -> None:
    table = Table()
    table.send("a" * 32)
    assert refused_as_duplicate(table.send("a" * 32))
    table.begin()
    table.end(S.SUCCEEDED)
    assert refused_as_duplicate(table.send("a" * 32))


def refused_as_duplicate(answer: Acceptance) -> bool:
    return (answer.accepted, answer.stamp_ns, answer.code) == (False, 0, "goal.duplicate")


def test_the_result_of_an_unknown_goal() -> None:
    with pytest.raises(UnknownGoal):
        Table().goals.result(UNKNOWN, None)


def test_cancels_that_cancel_nothing() -> None:
    table = Table()
    assert table.cancel(UNKNOWN) == (C.UNKNOWN_GOAL_ID, [])
    assert table.cancel() == (C.NONE, [])
    assert table.cancel(UNKNOWN_ID) == (C.NONE, [])
    done = table.send().identity
    table.begin()
    table.end(S.SUCCEEDED)
    assert table.cancel(done) == (C.GOAL_TERMINATED, [])
    assert table.cancel() == (C.NONE, [])
    assert table.cancel(UNKNOWN, 5) == (C.NONE, [])
    assert [code.value for code in C] == [0, 1, 2, 3]


def test_cancel_all() -> None:
    table = Table()
    one, other = table.send().identity, table.send().identity
    table.begin()
    assert table.cancel() == (C.NONE, [one, other])
    table.end(S.CANCELED)
    assert [table.goals.result(g, None).state.value for g in (one, other)] == [5, 5]
    assert table.history == {one: [1, 2, 3, 5], other: [1, 3, 5]}


def test_a_goal_that_was_sent_before_a_stop_is_refused_after_it() -> None:
    queue = Table().goals
    known = queue.stops
    queue.cancel(UNKNOWN, 0)  # names a goal, so it is no stop
    accepted, _ = queue.send(1, {}, "", stops=known)
    assert accepted.accepted
    queue.cancel("", 0)
    late, _ = queue.send(1, {}, "", stops=known)
    assert (late.accepted, late.code) == (False, "goal.sent_before_stop")
    for stops in (None, queue.stops):
        assert queue.send(1, {}, "", stops=stops)[0].code != "goal.sent_before_stop"


def test_cancel_by_time_compares_the_stamp_that_was_answered() -> None:
    table = Table()
    a, b, c = (table.send() for _ in range(3))
    table.begin()
    assert table.cancel(stamp_ns=a.stamp_ns - 1) == (C.NONE, [])
    assert table.cancel(stamp_ns=a.stamp_ns) == (C.NONE, [a.identity])
    assert table.cancel(c.identity, a.stamp_ns) == (C.NONE, [c.identity])
    table.end(S.CANCELED)
    table.begin()
    table.end(S.SUCCEEDED)
    ends = [table.goals.result(goal.identity, None).state.value for goal in (a, b, c)]
    assert ends == [5, 4, 5]


def test_cancel_by_time_takes_the_one_of_that_time_too() -> None:
    table = Table()
    a, b, c = (table.send() for _ in range(3))
    assert table.cancel(stamp_ns=b.stamp_ns) == (C.NONE, [a.identity, b.identity])
    assert table.cancel(a.identity, c.stamp_ns) == (C.NONE, [c.identity])


def test_cancel_twice() -> None:
    table = Table()
    goal = table.send().identity
    table.begin()
    assert table.cancel(goal) == (C.NONE, [goal])
    assert table.cancel(goal) == (C.GOAL_TERMINATED, [])
    assert table.cancel() == (C.NONE, [])
    table.end(S.CANCELED)
    assert table.goals.result(goal, None).state.value == 5


@pytest.mark.parametrize("end", [S.SUCCEEDED, S.ABORTED, S.CANCELED])
def test_a_goal_that_is_being_canceled_may_end_in_any_way(end: GoalState) -> None:
    table = Table()
    goal = table.send().identity
    table.begin()
    table.cancel()
    table.end(end)
    assert table.history[goal] == [1, 2, 3, end.value]


def test_results_for_waiting_threads_and_later_ones() -> None:
    table = Table()
    goal = table.send().identity
    reported: list[Outcome] = []
    table.begin()

    def ask() -> None:
        reported.append(table.goals.result(goal, None))

    with table.clock.working():
        clients = [table.clock.spawn(ask, "client") for _ in range(2)]
        assert reported == []
        table.end(S.SUCCEEDED)
        for client in clients:
            client.join()
    ask()
    assert [one.state.value for one in reported] == [4] * 3


def test_the_all_zero_name_is_one_like_any_other() -> None:
    assert Table().send(UNKNOWN_ID).accepted


def test_a_late_joiner_gets_all_goals() -> None:
    table = Table()
    sent = [table.send().identity for _ in range(9)]
    for _ in range(5):
        table.begin()
        table.end(S.SUCCEEDED)
    assert [status.identity for status in table.goals.all()] == sent
    assert [status.state.value for status in table.goals.all()] == [4] * 5 + [1] * 4


def test_results_are_forgotten_in_time() -> None:
    table = Table(keep=10.0)
    goal = table.send().identity
    table.begin()
    table.pass_time(60.0)  # only the end counts
    table.end(S.SUCCEEDED)
    for _ in range(3):
        table.pass_time(3.0)
        assert table.goals.result(goal, None).state is S.SUCCEEDED
    table.pass_time(1.0)
    with pytest.raises(UnknownGoal):
        table.goals.result(goal, None)
    assert table.cancel(goal)[0] is C.UNKNOWN_GOAL_ID
    assert table.goals.all() == ()


@pytest.mark.parametrize(("keep", "known"), [(0.0, 0), (math.inf, 1), (-1.0, 1)])
def test_results_can_be_kept_for_ever_or_not_at_all(keep: float, known: int) -> None:
    table = Table(keep=keep)
    goal = table.send().identity
    table.begin()
    reported: list[Outcome] = []
    with table.clock.working():
        client = table.clock.spawn(
            lambda: reported.append(table.goals.result(goal, None)), "client"
        )
        table.pass_time(1.0)  # the thread waits by now
        table.end(S.SUCCEEDED)
        client.join()
    table.pass_time(1e6)
    assert len(reported) == 1  # threads that wait already get the result
    assert len(table.goals.all()) == known


def test_the_queue_is_limited() -> None:
    table = Table()
    table.send()
    table.begin()
    waiting = [table.send().identity for _ in range(WAITING)]
    refused = table.send()
    assert (refused.accepted, refused.stamp_ns, refused.code) == (False, 0, "goal.queue_full")
    assert f"{WAITING} goals are waiting" in refused.message
    table.cancel(waiting[0])
    assert table.send().accepted
    assert not table.send().accepted


def test_only_the_newest_results_are_kept() -> None:
    table = Table(keep=math.inf)
    ended = []
    for _ in range(KEPT + 10):
        ended.append(table.send().identity)
        table.begin()
        table.end(S.SUCCEEDED)
    left = table.send().identity
    assert [status.identity for status in table.goals.all()] == [*ended[10:], left]
    with pytest.raises(UnknownGoal):
        table.goals.result(ended[9], None)
    assert table.goals.result(ended[10], None).success


def test_the_newest_results_are_those_of_the_goals_that_ended_last() -> None:
    table = Table(keep=math.inf)
    long = table.send().identity
    table.begin()
    for _ in range(KEPT):
        table.cancel(table.send().identity)
    table.pass_time(1.0)
    table.end(S.SUCCEEDED)
    assert table.goals.result(long, None).success


def test_an_accepted_goal_is_the_current_one_before_it_runs() -> None:
    table = Table(Policy.QUEUE)
    first, second = (table.send().identity for _ in range(2))
    assert table.goals.running is None
    assert table.goals.current is not None
    assert (table.goals.current.identity, table.goals.waiting) == (first, (second,))


def test_a_waiting_goal_can_be_canceled_if_no_results_are_kept() -> None:
    table = Table(keep=0.0)
    goal = table.send().identity
    _, canceled, _ = table.goals.cancel("", 0)
    assert [each.identity for each in canceled] == [goal]
    assert table.goals.all() == ()


def test_asking_ends_in_time() -> None:
    table = Table()
    goal = table.send().identity
    with table.clock.working(), pytest.raises(ResultTimeout, match="within 2 s") as caught:
        table.goals.result(goal, 2.0)
    assert isinstance(caught.value, TimeoutError)
    assert table.clock.now() == pytest.approx(2.0)


@pytest.mark.parametrize("name", ["1", "A" * 32, "a" * 33, "g" * 32, "a" * 31 + "\n", " " * 32])
def test_a_name_is_32_digits(name: str) -> None:
    answer = Table().send(name)
    assert (answer.accepted, answer.code) == (False, "goal.bad_id")


# A second goal


def test_a_second_goal_is_refused() -> None:
    table = Table(Policy.REJECT)
    first = table.send().identity
    second = table.send()  # while the first waits to begin
    assert (second.accepted, second.stamp_ns, second.code) == (False, 0, "goal.busy")
    assert first in second.message
    table.begin()
    assert table.send().code == "goal.busy"
    table.cancel()
    assert table.send().code == "goal.busy"  # not before the arm has stopped
    table.end(S.CANCELED)
    assert table.send().accepted


def test_a_second_goal_takes_the_place_of_those_before() -> None:
    table = Table(Policy.PREEMPT)
    first = table.send().identity
    running = table.begin()
    second, third = table.send().identity, table.send().identity
    assert getattr(running.mailbox.fault, "code", "") == "goal.preempted"
    assert table.goals.result(second, None).code == "goal.preempted"
    assert table.history[second] == [1, 2, 6]
    table.end(S.ABORTED)
    assert table.begin().identity == third
    assert table.history[first] == [1, 2, 6]


def test_the_first_preemption_counts() -> None:
    table = Table(Policy.PREEMPT)
    table.send()
    running = table.begin()
    second = table.send().identity
    table.send()
    assert second in str(running.mailbox.fault)


def test_no_goal_begins_before_the_stop_for_the_last_one_is_done() -> None:
    table = Table()
    table.send()
    table.begin()
    *_, running = table.goals.cancel("", 0)
    assert running
    ended = threading.Event()

    def end() -> None:
        table.end(S.CANCELED)
        ended.set()

    with table.clock.working():
        thread = table.clock.spawn(end, "owner")
        assert not ended.wait(0.05)
        table.goals.stopped(running)
        thread.join()


def test_closed() -> None:
    table = Table()
    table.goals.close()
    assert table.send().code == "server.closing"
    assert table.goals.take() is None


TWO_MOVES = """\
task: 15
name: two_moves
description: Move there and back.
tree:
  sequence:
    - {subtree: move_joints, with: {joints: {joint_1: 0.1}}}
    - {subtree: move_joints, with: {joints: {joint_1: 0.0}}}
"""


def test_a_goal_may_have_any_identity_while_others_are_validated(
    server: RigMaker, tmp_path: Path
) -> None:
    (tmp_path / "15_two_moves.yaml").write_text(TWO_MOVES)
    arm = server(tasks=tmp_path)
    at_frame(arm, 3, lambda: arm.executive.send(15, strict=True))
    assert arm.executive.send(15, identity=UNKNOWN_ID, strict=True).accepted
    outcome = arm.executive.result(UNKNOWN_ID)
    assert outcome.success, outcome
