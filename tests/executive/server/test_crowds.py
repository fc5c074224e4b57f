"""Many clients at once: a stop is answered, and a motion is not disturbed."""

import contextlib
import logging
import os
import resource
import threading

import pytest
from websockets.frames import Frame, Opcode

import logs
from executive.api.events import Event
from executive.api.outcome import CancelResult
from executive.server import event_hub
from executive.server.http import app, endpoints as api
from executive.server.limits import connections, fair_queue
from executive.server.server import MAX_CONNECTIONS
from hardware import HostLimit
from tests.support.servers.foreign_clients import GOAL, UPGRADE, answer, head, raw, stops
from tests.support.servers.serving import Serve

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]


def test_idle_connections_are_closed_to_make_room(serve: Serve) -> None:
    served = serve()
    with contextlib.ExitStack() as stack:
        crowd = [stack.enter_context(raw(served, "GET / HTTP/1.1")) for _ in range(150)]
        crowd += [
            stack.enter_context(raw(served, *head(served, "content-length: 9", "")))
            for _ in range(150)
        ]
        assert stops(served)
        goal = served.ask("POST", "/api/goals", {"task": 11})[1]["goal_id"]
        assert served.ask("GET", f"/api/goals/{goal}/result")[1]["success"]
        assert served.server.connections <= MAX_CONNECTIONS


def test_a_stop_is_not_queued(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    served = serve()
    goal = served.executive.send(10).identity
    monkeypatch.setattr(fair_queue, "REST_FACTOR", 1e9)
    with contextlib.ExitStack() as stack:
        ask = ("GET /api/health HTTP/1.1", *head(served, "")[1:])
        for _ in range(150):  # one is processed; the rest after it lasts for years
            stack.enter_context(raw(served, *ask))
        assert served.ask("POST", "/api/stop", token=False) == (
            200,
            {"return_code": 0, "goals": [goal]},
        )


STOP = "POST /api/stop HTTP/1.1"
LONG = [f"a{number}: b" for number in range(300)]


@pytest.mark.parametrize(
    "heads",
    [
        [[STOP, "host: evil.example", ""]],
        [[STOP, "host: {own}", "host: {own}", ""]],
        [[STOP, "host: {own}", "origin: http://evil.example", ""]],
        [[STOP, "host: {own}", *LONG, ""]],
        [["POST http://{own}/api/stop HTTP/1.1", "host: {own}", ""]],
        [[STOP], ["host: {own}", ""]],
        [["GET / HTTP/1.1"], [STOP, "host: {own}", ""]],
        [
            ["POST /api/cancel HTTP/1.1", "host: {own}", "content-length: 90", ""],
            [STOP, "host: {own}", ""],
        ],
    ],
    ids=["foreign", "two hosts", "page", "long", "url", "two pieces", "in a head", "in a body"],
)
def test_only_a_short_stop_of_an_accepted_client_is_not_queued(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, heads: list[list[str]]
) -> None:
    served = serve()
    own = f"127.0.0.1:{served.server.port}"
    queued: list[bytes] = []
    put = fair_queue.FairQueue.put

    def watched(
        queue: fair_queue.FairQueue, connection: object, data: bytes, priority: bool
    ) -> None:
        queued.append(data)
        put(queue, connection, data, priority)  # type: ignore[arg-type]

    monkeypatch.setattr(fair_queue.FairQueue, "put", watched)
    with raw(served) as connection:
        sent = b""
        for lines in heads:
            data = "".join(f"{line.format(own=own)}\r\n" for line in lines).encode()
            sent += data
            connection.sendall(data)
            while len(b"".join(queued)) < len(sent) and stops(served):
                pass
    assert b"".join(queued) == sent


def test_stops_that_come_together_share_one(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    served = serve()
    cancel, begun, held = served.executive.cancel, threading.Event(), threading.Event()
    calls: list[str] = []

    def counted(identity: str = "", stamp_ns: int = 0) -> CancelResult:
        calls.append(identity)
        begun.set()
        held.wait(10)
        return cancel(identity, stamp_ns)

    goal = served.executive.send(10).identity
    monkeypatch.setattr(served.executive, "cancel", counted)
    head = f"{STOP}\r\nhost: 127.0.0.1:{served.server.port}\r\nconnection: close\r\n\r\n"
    with contextlib.ExitStack() as stack:
        first = stack.enter_context(raw(served))
        first.sendall(head.encode())
        begun.wait(10)
        others = [stack.enter_context(raw(served)) for _ in range(20)]
        for each in others:
            each.sendall(head.encode())
        assert served.ask("GET", "/api/health")[0] == 200  # the others have arrived
        held.set()
        assert goal.encode() in answer(first)
        assert all(b"HTTP/1.1 200" in answer(each) for each in others)
    assert len(calls) == 2
    monkeypatch.undo()
    served.executive.result(goal)
    goal = served.executive.send(10).identity
    assert goal in served.ask("POST", "/api/stop", token=False)[1]["goals"]


def test_a_stop_is_answered_if_streams_take_all_connections(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 2)
    served = serve(rosbridge=True)
    own = f"host: 127.0.0.1:{served.server.port}"
    watch = ("GET /api/events HTTP/1.1", own, "")
    with raw(served, "GET / HTTP/1.1", own, *UPGRADE, "") as socket, raw(served, *watch) as stream:
        assert b" 101 " in socket.recv(1000)
        assert b" 200 " in stream.recv(1000)
        assert stops(served)
        with raw(served, *watch) as newer:
            assert b" 200 " in newer.recv(1000)
            assert stops(served)
            assert served.server.connections <= 2


def test_the_websocket_that_is_idle_for_longest_makes_room(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 4)
    served = serve(rosbridge=True)
    subscribe = Frame(Opcode.TEXT, b'{"op": "subscribe", "topic": "/joint_states"}').serialize(
        mask=True
    )
    lines = ("GET / HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", *UPGRADE, "")
    with contextlib.ExitStack() as stack:
        sockets = []
        for _ in range(4):
            sockets.append(stack.enter_context(raw(served, *lines)))
            assert b" 101 " in sockets[-1].recv(1000)
        for each in (sockets[0], sockets[3], sockets[1]):  # the third is idle for longest
            each.sendall(subscribe)
            assert each.recv(1000)
        assert served.ask("GET", "/api/health")[0] == 200
        assert sockets[2].recv(1000) == b""
        for each in (sockets[0], sockets[1], sockets[3]):
            each.sendall(subscribe)
            assert each.recv(1000)


def test_the_limit_of_open_files_is_checked_at_the_start(serve: Serve) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken = len(os.listdir("/proc/self/fd"))
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (taken + 20, hard))
        with pytest.raises(HostLimit, match=f"may open {taken + 20} files.*ulimit -n 1024"):
            serve()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_idle_strangers_do_not_end_a_hold(serve: Serve) -> None:
    served = serve()
    with contextlib.ExitStack() as stack:
        hold = f"POST /api/goals/{GOAL}/hold HTTP/1.1"
        lines = (hold, *head(served, "transfer-encoding: chunked", "")[1:])
        holding = stack.enter_context(raw(served, *lines))
        body = {"task": 10, "goal_id": GOAL, "deadman": True}
        holding.sendall(b"1\r\n \r\n")
        assert served.ask("POST", "/api/goals", body)[0] == 201
        for number in range(150):
            stack.enter_context(raw(served))
            if number % 10 == 0:
                holding.sendall(b"1\r\n \r\n")
        assert served.ask("GET", "/api/health")[0] == 200
        holding.sendall(b"0\r\n\r\n")
        assert b'"canceled":true' in answer(holding)
        assert served.server.connections <= MAX_CONNECTIONS


def test_a_flood_does_not_disturb_a_motion(serve: Serve) -> None:
    served = serve()
    ended = threading.Event()

    def flood() -> None:
        while not ended.is_set():
            with contextlib.suppress(OSError), raw(served, "GET / HTTP/1.1", "x" * 1000):
                served.ask("POST", "/api/goals", b"[" * 60_000)

    floods = [threading.Thread(target=flood) for _ in range(2)]
    sent: list[logs.Sent] = []

    def watch(event: Event) -> None:
        if isinstance(event, logs.Sent):
            sent.append(event)

    served.executive.subscribe(watch)
    for thread in floods:
        thread.start()
    with served.client() as client:
        outcome = client.run(1)
    ended.set()
    for thread in floods:
        thread.join()
    assert len(sent) == outcome.frames
    assert all(frame.scheduled is not None for frame in sent)


def test_stops_without_a_goal_do_not_fill_the_log(
    serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    served = serve()
    assert all(stops(served) for _ in range(20))
    assert sum("no goal was under way" in each.message for each in caplog.records) == 3


def test_requests_are_limited_and_stops_are_not(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "RATE_LIMITS", dict.fromkeys((True, False), (0.001, 3.0)))
    served = serve()
    for token in (False, True):  # strangers use up only their own limit
        found = [served.ask("GET", "/api/health", token=token)[0] for _ in range(5)]
        assert found == [200, 200, 200, 429, 429]
    assert all(stops(served) for _ in range(20))


def test_waiting_strangers_leave_room_for_others(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "MAX_STREAMS", 1)
    served = serve()
    goal = served.executive.send(10).identity
    asked = f"GET /api/goals/{goal}/result HTTP/1.1"
    with raw(served, asked, f"host: 127.0.0.1:{served.server.port}", "", "") as waiting:
        while served.ask("GET", f"/api/goals/{goal}/result?timeout=0", token=False)[0] != 429:
            pass
        assert served.ask("GET", f"/api/goals/{goal}/result?timeout=0")[0] == 409
        served.executive.cancel()
        assert b"CANCELED" in answer(waiting)


def test_watching_strangers_leave_room_for_others(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(api, "MAX_SUBSCRIBERS", 1)
    served = serve()
    watch = ("GET /api/events HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "")
    with raw(served, *watch) as stranger, served.client() as client:
        assert stranger.recv(15) == b"HTTP/1.1 200 OK"
        while served.ask("GET", "/api/events", token=False)[0] != 429:
            pass
        with client.events("goal"):
            assert served.ask("GET", "/api/events")[0] == 429


def test_a_list_of_goals_is_limited(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "MAX_LISTED", 2)
    served = serve()
    with served.client() as client:
        assert all(client.run(11).success for _ in range(5))
        known = served.executive.goals()
        identities = [goal.identity for goal in known]
        assert [goal.identity for goal in client.goals()] == identities

    def listed(query: str) -> list[str]:
        status, reported = served.ask("GET", f"/api/goals{query}")
        return (
            [goal["goal_id"] for goal in reported["goals"]] if status == 200 else [reported["code"]]
        )

    assert listed("") == identities[-2:]
    assert listed(f"?before={known[-2].stamp_ns}") == identities[-4:-2]
    assert listed(f"?before={known[-2].stamp_ns}&limit=1") == identities[-3:-2]
    assert listed(f"?before={known[0].stamp_ns}") == []
    assert listed("?limit=4") == identities[-4:]
    for wrong in ("limit=0", "limit=151", "limit=1.5", "limit=x", "before=-1", f"before={10**30}"):
        assert listed(f"?{wrong}") == ["request.malformed"]


def test_a_subscriber_that_does_not_read_is_dropped(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_hub, "MAX_BACKLOG", 100_000)
    monkeypatch.setattr(connections, "STALL_SECONDS", 0.2)
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.2)
    monkeypatch.setattr(api, "MAX_SUBSCRIBERS", 2)
    served = serve()
    with (
        served.client() as client,
        client.events("log") as events,
        raw(served, "GET /api/events HTTP/1.1", *head(served, "")[1:]) as slow,
    ):
        assert slow.recv(15) == b"HTTP/1.1 200 OK"
        for number in range(200):
            line = logs.LogLine(served.clock.now(), 20, "test", f"{number} {'x' * 10_000}")
            served.executive.record(line)
            assert next(events).message.startswith(f"{number} ")  # type: ignore[union-attr]
        assert b"".join(iter(lambda: slow.recv(65_536), b"")).count(b"\n\n") < 200
        assert client.run(11).success
