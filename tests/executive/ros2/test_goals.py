"""The goals of a server, as its events report them, and the ROS 2 that a process finds."""

import asyncio
import logging
import os
from dataclasses import replace
from pathlib import Path

import pytest

from executive.api.outcome import GoalState, GoalStatus, Outcome
from executive.ros2 import installation
from executive.ros2.bridge import Bridge
from executive.ros2.goals import MOST_ENDED, Goals
from tests.support.servers.serving import Serve, Typed

pytest_plugins = ["tests.support.servers.server_fixtures"]


def status(identity: str, state: GoalState) -> GoalStatus:
    ended = state.value > GoalState.CANCELING.value
    outcome = Outcome.of(1, state, None) if ended else None
    return GoalStatus(identity, 1, state, 0, outcome)


def test_a_goal_never_returns_to_an_earlier_state() -> None:
    seen: list[GoalStatus] = []
    goals = Goals(seen.append)
    states = (GoalState.EXECUTING, GoalState.ACCEPTED, GoalState.ABORTED, GoalState.SUCCEEDED)
    for state in states:
        goals.take(status("a", state))
    assert [each.state for each in seen] == [GoalState.EXECUTING, GoalState.ABORTED]


def test_all_who_wait_get_the_end_of_a_goal_also_if_the_server_is_lost() -> None:
    async def act() -> None:
        goals = Goals(lambda goal: None)
        first = asyncio.create_task(goals.seen("a"))
        await asyncio.sleep(0)
        for identity in "ab":
            goals.take(status(identity, GoalState.EXECUTING))
        assert (await first).identity == "a"
        waiting = [asyncio.create_task(goals.end(each)) for each in "aab"]
        await asyncio.sleep(0)
        waiting[0].cancel()
        goals.take(status("b", GoalState.SUCCEEDED))
        goals.lose(frozenset("a"))
        assert not waiting[1].done()
        goals.lose()
        ends = await asyncio.gather(*waiting[1:])
        assert [end.state for end in ends] == [GoalState.ABORTED, GoalState.SUCCEEDED]
        outcome = ends[0].outcome
        assert outcome
        assert outcome.text().startswith("task 1 lost: the server does not answer any more")

    asyncio.run(act())


def test_the_oldest_goals_that_ended_are_forgotten() -> None:
    goals = Goals(lambda goal: None)
    goals.take(status("under way", GoalState.EXECUTING))
    for number in range(MOST_ENDED + 2):
        goals.take(replace(status(str(number), GoalState.SUCCEEDED)))
    assert [*goals.known][:2] == ["under way", "2"]


def test_the_tasks_of_a_bridge_follow_their_files(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.ros2.bridge._TASKS_SECONDS", 0.0)
    served = serve(active=False)

    async def act() -> None:
        log = logging.getLogger()
        async with Bridge(served.server.url, served.robot, log) as bridge, asyncio.timeout(20):
            changed = asyncio.Event()
            bridge.on_tasks.append(changed.set)
            parts = [asyncio.create_task(each) for each in (bridge.run(), bridge.follow_tasks())]
            await changed.wait()
            before = {each.name for each in bridge.tasks}
            changed.clear()
            new = served.tasks / "11_nothing.yaml"
            later = served.folder / "15_later.yaml"
            later.write_text(new.read_text().replace("11", "15").replace("nothing", "later"))
            later.rename(served.tasks / later.name)  # the bridge sees no unfinished file
            await changed.wait()
            assert {each.name for each in bridge.tasks} == {*before, "later"}
            for part in parts:
                part.cancel()
            await asyncio.wait(parts)

    asyncio.run(act())


def test_a_bridge_knows_the_new_state_of_the_arm_after_a_transition(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve(active=False)

    async def act() -> None:
        log, loop = logging.getLogger(), asyncio.get_running_loop()
        async with Bridge(served.server.url, served.robot, log) as bridge, asyncio.timeout(20):
            following = asyncio.create_task(bridge.run())
            await bridge.connected()
            take = bridge._take
            monkeypatch.setattr(bridge, "_take", lambda event: loop.call_later(0.1, take, event))
            await bridge.change_arm("activate")  # its events come after its answer
            assert bridge.arm == "active"
            following.cancel()
            await asyncio.wait([following])

    asyncio.run(act())


def test_only_this_machine_finds_the_node_unless_the_user_wants_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("ROS_LOCALHOST_ONLY", raising=False)
    monkeypatch.setenv(installation.DISCOVERY, "")
    monkeypatch.delenv(installation.DISCOVERY)
    assert installation.stay_on_this_machine()
    assert os.environ[installation.DISCOVERY] == "LOCALHOST"
    monkeypatch.setenv(installation.DISCOVERY, "SUBNET")
    assert not installation.stay_on_this_machine()
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    assert installation.stay_on_this_machine()


def test_without_ros_the_command_says_how_to_install_it(
    typed: tuple[object, Typed], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert installation.environment(tmp_path) is None
    monkeypatch.setattr(installation, "environment", lambda: None)
    monkeypatch.setattr(installation, "is_ready", lambda: False)
    code, _, printed = typed[1]("ros2")
    assert code == 2
    assert "install the wheel again with [ros2] behind its name" in printed.replace("\n", " ")
