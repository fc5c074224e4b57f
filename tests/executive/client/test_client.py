"""The clients in Python, sync and async."""

import asyncio
import logging
import math
import os
import socket
import threading
from pathlib import Path

import pytest

import logs
from armtree import AsyncClient, Client, GoalFailed, Refused, ServerUnreachable
from executive.api import token_file
from executive.cli.support.log_handler import recorded_log
from executive.client import transport
from executive.errors import WrongAnswer
from tests.support.generated.sync_client import TARGET, synchronous
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]


def test_the_synchronous_client(serve: Serve) -> None:
    served = serve()
    with Client(served.server.url) as arm:
        assert arm.run(11).success
        assert arm.run("say", what="hello").success
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


def test_recordings_name_the_client(serve: Serve, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    served = serve()
    lines: list[str] = []
    served.executive.subscribe(lambda event: lines.append(getattr(event, "message", "")))
    with recorded_log(served.executive), Client(served.server.url, name="robot/1\t(me)") as arm:
        goal = arm.send(10)
        with arm.events("goal") as events:
            next(events)
        arm.pause(goal)
        assert arm.stop().goals == (goal,)
        arm.result(goal)
        assert [each["task"] for each in arm.recordings(task=10)] == [10]
        served.ask("GET", "/api/session", headers={"user-agent": "robot/1"})
        served.ask("POST", "/api/stop", headers={"user-agent": "robot/2"})  # a new connection
    for words in (
        f"Executing the goal for task 10 ({goal}) from robot/1\t(me)",
        f"POST /api/goals/{goal}/pause from robot/1\t(me)",
        "Received a stop from robot/1\t(me)",
        "Received a stop from robot/2",
    ):
        assert words in lines
    assert not any("GET" in line for line in lines)


def test_a_task_is_planned_and_nothing_moves(serve: Serve) -> None:
    served = serve()
    with Client(served.server.url) as arm:
        planned = arm.plan("pick")
        assert any(isinstance(event, logs.Plan) for event in planned.events)
        assert getattr(planned.events[-1], "outcome", None)
        assert planned.unknown == ()
        assert arm.goals() == ()
        with pytest.raises(Refused, match="task number 99"):
            arm.plan(99)


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


def test_the_token_is_sent_only_to_the_address_of_the_server(serve: Serve) -> None:
    """Another user's program may listen on the same port of another address."""
    served = serve()
    port, heads = served.server.port, list[bytes]()

    def record(listener: socket.socket) -> None:
        for _ in range(2):
            connection, _ = listener.accept()
            with connection:
                heads.append(connection.recv(65_536))
                connection.sendall(b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n")

    with (
        socket.create_server(("::1", port), family=socket.AF_INET6) as six,
        socket.create_server(("127.0.0.2", port)) as other,
    ):
        threads = [
            threading.Thread(target=record, args=(each,), daemon=True) for each in (six, other)
        ]
        for thread in threads:
            thread.start()
        for host in ("localhost", "LOCALHOST", "127.0.0.1"):
            with Client(f"http://{host}:{port}/") as client:
                assert (client.url, client.run(11).success) == (served.server.url, True)
        for host in ("[::1]", "127.0.0.2", "[::1]", "127.0.0.2"):
            with Client(f"http://{host}:{port}") as client, pytest.raises(WrongAnswer):
                client.status()
        for thread in threads:
            thread.join(10)
    assert len(heads) == 4
    assert not any(b"authorization" in head.lower() for head in heads)


def test_localhost_is_the_address_at_which_servers_listen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It may also mean ::1, where another user's program would be sent the token."""
    monkeypatch.setenv("ARMTREE_TOKEN", "secret")
    for url, found in {
        "http://localhost:9": "http://127.0.0.1:9",
        "http://LocalHost": "http://127.0.0.1",
        "https://localhost:9": "https://localhost:9",  # it has a certificate
        "http://localhost.example": "http://localhost.example",
    }.items():
        address = transport.Address.find(url, None)
        assert address.url == found
        assert address.headers["host"] == found.partition("//")[2]


def test_a_process_of_another_user_is_not_the_server_that_had_its_number() -> None:
    found = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    others = [pid for pid in found if Path("/proc", str(pid)).stat().st_uid != os.getuid()]
    for pid in (*others[:1], 2**30):
        assert not token_file.ServerInfo("http://127.0.0.1:9", "secret", pid).is_running
    assert token_file.ServerInfo("http://127.0.0.1:9", "secret", os.getpid()).is_running


@pytest.mark.parametrize(
    ("address", "url"), [("0.0.0.0", "http://127.0.0.1"), ("::", "http://[::1]")]
)
def test_a_server_of_all_addresses_names_one_of_this_machine(
    serve: Serve, address: str, url: str
) -> None:
    served = serve(address=address, expose=True)
    port = served.server.port
    assert served.server.url == f"{url}:{port}"
    with Client(f"http://localhost:{port}") as client:
        assert client.run(11).success


def test_the_token_is_read_from_a_regular_file_only(serve: Serve, tmp_path: Path) -> None:
    port = serve().server.port
    file = token_file.file_of(port)
    aside = file.rename(tmp_path / "aside")
    file.symlink_to(aside)
    assert token_file.read(port) is None
    file.unlink()
    os.mkfifo(file)
    assert "authorization" not in transport.Address.find(f"http://localhost:{port}", None).headers
    file.unlink()
    file.write_text("[" * 4000)
    assert token_file.read(port) is None
    aside.replace(file)
    assert token_file.read(port)


def test_the_synchronous_client_is_made_from_the_other() -> None:
    assert synchronous() == TARGET.read_text()


@pytest.mark.slow
def test_moves_of_both_clients(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    # A busy machine may keep a client from holding its goal for a second.
    monkeypatch.setattr("executive.server.http.endpoints.HOLD_SECONDS", 30.0)
    served = serve()

    async def drive() -> None:
        async with AsyncClient(served.server.url) as arm:
            assert (await arm.move(0.1, 0.1, 0.1, deadman=True)).success
            assert (await arm.where()).tool == pytest.approx((0.1, 0.1, 0.1), abs=1e-5)
            assert (await arm.home()).success

    asyncio.run(drive())
    with Client(served.server.url) as arm:
        assert arm.move("upright", joint_4="-10 deg", joint_1=0.1, speed=0.5).success
        found = arm.where()
        assert found == served.executive.where()
        assert found.limits["joint_1"] == pytest.approx((-math.pi / 2, math.pi / 2))
        assert (found.commanded or {})["joint_1"] == 0.1
        with pytest.raises(Refused, match="did you mean folded") as refused:
            arm.move("foldd")
        assert refused.value.code == "goal.bad_target"
        assert [goal.task for goal in arm.goals()] == [-1, -1, -1]
