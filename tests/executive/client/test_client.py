"""The clients in Python, sync and async."""

import asyncio

import pytest

from armtree import AsyncClient, Client, GoalFailed, Refused, ServerUnreachable
from tests.support.generated.sync_client import TARGET, synchronous
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]


def test_the_synchronous_client(serve: Serve) -> None:
    served = serve()
    with Client(served.server.url) as arm:
        assert arm.run(11).success
        assert arm.run(12, what="hello").success
        with pytest.raises(GoalFailed, match="task 13 ABORTED") as failed:
            arm.run(13)
        assert failed.value.code == failed.value.outcome.code == "task.failed"
        with pytest.raises(Refused) as refused:
            arm.arm("activate")
        assert refused.value.code == "hw.transition_refused"
        assert [task.number for task in arm.tasks()][:3] == [0, 1, 2]
        assert len(arm.goals()) == 3
    with pytest.raises(Refused, match="the token is wrong"):
        Client(served.server.url, "x").run(11)
    served.stop()
    with pytest.raises(ServerUnreachable, match="armtree serve"):
        Client(served.server.url).status()


def test_the_asynchronous_client(serve: Serve) -> None:
    served = serve()

    async def drive() -> None:
        async with AsyncClient(served.server.url) as arm:
            assert (await arm.run(11)).success
            assert (await arm.run(11, deadman=True)).success
            async with arm.events("status") as events:
                goal = await arm.send(10)
                states = [getattr(await anext(events), "state", None) for _ in range(2)]
                assert (await arm.status()).goal == await arm.goal(goal)
                assert (await arm.stop()).goals == (goal,)
                states += [getattr(await anext(events), "state", None) for _ in range(2)]
            assert [state.name for state in states if state][-1] == "CANCELED"
            with pytest.raises(Refused):
                await arm.pause(goal)

    asyncio.run(drive())


def test_the_synchronous_client_is_made_from_the_other() -> None:
    assert synchronous() == TARGET.read_text()
