"""Strangers: foreign pages, bad bodies, slow and greedy clients. The stop is always answered."""

import contextlib
import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import logs
from executive.executive import Event
from executive.server import access, api, app, connections, hub, turns
from executive.server.operations import OPERATIONS
from executive.server.server import AddressInUse, ServerError
from tests.serving import Serve, Served

pytest_plugins = ["tests.server_fixtures"]

GOAL = "0123456789abcdef" * 2


def path_of(template: str) -> str:
    return template.format(goal_id=GOAL, transition="configure", question_id="01234567")


@contextlib.contextmanager
def raw(served: Served, *lines: str) -> Iterator[socket.socket]:
    """A connection on which these lines of a head were sent."""
    with socket.create_connection(("127.0.0.1", served.server.port), 10) as connection:
        connection.sendall("".join(f"{line}\r\n" for line in lines).encode())
        yield connection


def answer(connection: socket.socket) -> bytes:
    """All that comes until the server closes the connection."""
    found = b""
    with contextlib.suppress(ConnectionResetError):
        while data := connection.recv(65_536):
            found += data
    return found


def stops(served: Served) -> bool:
    return served.ask("POST", "/api/stop", token=False)[0] == 200


def test_only_a_stop_needs_no_token(serve: Serve) -> None:
    served = serve()
    for operation in OPERATIONS:
        if operation.method == "GET":
            continue
        status, error = served.ask("POST", path_of(operation.path), token=False)
        assert (status != 401) == operation.stops, operation.path
        if not operation.stops:
            assert error["code"] == "request.token"
            wrong = {"authorization": "Bearer x"}
            assert served.ask("POST", path_of(operation.path), {}, wrong)[0] == 401
    assert served.executive.goals() == ()


def test_beyond_this_machine_reading_needs_it_too(serve: Serve) -> None:
    served = serve(expose=True)
    for operation in OPERATIONS:
        status = served.ask(operation.method, path_of(operation.path), token=False)[0]
        assert (status == 401) != operation.stops, operation.path
    assert served.ask("GET", "/api/status")[0] == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"host": "127.0.0.1"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
    ],
)
def test_a_foreign_page_or_name_may_do_nothing(serve: Serve, headers: dict[str, str]) -> None:
    served = serve()
    goal = served.executive.send(10).identity
    for operation in OPERATIONS:
        path = operation.path.format(goal_id=goal, transition="deactivate", question_id="01234567")
        status, error = served.ask(operation.method, path, headers=headers)
        assert (status, error["code"].partition(".")[0]) == (403, "request")
    assert served.executive.goals()[0].outcome is None
    assert served.executive.snapshot().arm.value == "active"


def test_what_is_no_http_is_answered_and_closed(serve: Serve) -> None:
    served = serve()
    for nonsense in ("\x16\x03\x01\x02", "GET", "GET / HTTP/1.1", "A" * 100_000):
        with raw(served, nonsense, "", "") as connection:
            said = answer(connection)
            assert said.startswith(b"HTTP/1.1 400")
            assert json.loads(said.partition(b"\r\n\r\n")[2])["code"] == "request.malformed"
    assert stops(served)


HEAD = ("POST /api/goals HTTP/1.1", "host: 127.0.0.1:{port}", "authorization: Bearer {token}")


def head(served: Served, *more: str) -> list[str]:
    known = {"port": served.server.port, "token": served.server.token}
    return [line.format(**known) for line in (*HEAD, "content-type: application/json", *more)]


def test_a_huge_body_is_not_read(serve: Serve) -> None:
    served = serve()
    with raw(served, *head(served, "content-length: 1000000000", "")) as connection:
        assert b" 413 " in answer(connection)
    with raw(served, *head(served, "transfer-encoding: chunked", "")) as connection:
        with contextlib.suppress(ConnectionError):
            for _ in range(100):
                connection.sendall(b"1000\r\n" + b" " * 4096 + b"\r\n")
        assert b" 413 " in answer(connection)[:100] or stops(served)
    assert stops(served)


def test_a_slow_body_is_given_up(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(app, "BODY_SECONDS", 0.1)
    served = serve()
    with raw(served, *head(served, "content-length: 100", "")) as connection:
        connection.sendall(b"{")
        assert b" 408 " in answer(connection)


def test_a_slow_head_is_given_up(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.1)
    served = serve()
    with raw(served, "GET /api/health HTTP/1.1") as connection:
        assert answer(connection) == b""
    # nor may the next request of a connection take its time
    with raw(served, "GET /api/health HTTP/1.1", *head(served, "")[1:]) as connection:
        connection.sendall(b"GET ")
        assert answer(connection).count(b"HTTP/1.1 200") == 1


def test_a_crowd_that_asks_for_nothing_makes_room(serve: Serve) -> None:
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
        assert served.server.connections <= connections.MOST_CONNECTIONS


def test_a_stop_waits_for_no_turn(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    served = serve()
    goal = served.executive.send(10).identity
    monkeypatch.setattr(turns, "REST", 1e9)
    with contextlib.ExitStack() as stack:
        ask = ("GET /api/health HTTP/1.1", *head(served, "")[1:])
        for _ in range(150):  # one is let in; that was enough for years
            stack.enter_context(raw(served, *ask))
        assert served.ask("POST", "/api/stop", token=False) == (
            200,
            {"return_code": 0, "goals": [goal]},
        )


def test_requests_in_advance_are_not_answered(serve: Serve) -> None:
    served = serve()
    ask = ("GET /api/health HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "")
    with raw(served, *ask * 8) as connection:
        assert answer(connection).count(b"HTTP/1.1 200") == 1


def test_strangers_who_are_idle_do_not_end_a_hold(serve: Serve) -> None:
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
        assert served.server.connections <= connections.MOST_CONNECTIONS


def test_an_arm_in_motion_notices_nothing(serve: Serve) -> None:
    served = serve()
    ended = threading.Event()

    def pester() -> None:
        while not ended.is_set():
            with contextlib.suppress(OSError), raw(served, "GET / HTTP/1.1", "x" * 1000):
                served.ask("POST", "/api/goals", b"[" * 60_000)

    pests = [threading.Thread(target=pester) for _ in range(2)]
    sent: list[logs.Sent] = []

    def watch(event: Event) -> None:
        if isinstance(event, logs.Sent):
            sent.append(event)

    served.executive.subscribe(watch)
    for pest in pests:
        pest.start()
    with served.client() as client:
        outcome = client.run(1)
    ended.set()
    for pest in pests:
        pest.join()
    assert len(sent) == outcome.frames
    assert all(frame.scheduled is not None for frame in sent)


def test_too_many_requests_but_never_too_many_stops(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "LIMITS", dict.fromkeys((True, False), (0.001, 3.0)))
    served = serve()
    for token in (False, True):  # strangers use up what is theirs, and no more
        found = [served.ask("GET", "/api/health", token=token)[0] for _ in range(5)]
        assert found == [200, 200, 200, 429, 429]
    assert all(stops(served) for _ in range(20))


def test_strangers_who_wait_leave_room_for_others(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "MOST_STREAMS", 1)
    served = serve()
    goal = served.executive.send(10).identity
    asked = f"GET /api/goals/{goal}/result HTTP/1.1"
    with raw(served, asked, f"host: 127.0.0.1:{served.server.port}", "", "") as waiting:
        while served.ask("GET", f"/api/goals/{goal}/result?timeout=0", token=False)[0] != 429:
            pass
        assert served.ask("GET", f"/api/goals/{goal}/result?timeout=0")[0] == 409
        served.executive.cancel()
        assert b"CANCELED" in answer(waiting)


def test_strangers_who_watch_leave_room_for_others(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(api, "MOST_WATCHERS", 1)
    served = serve()
    watch = ("GET /api/events HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "")
    with raw(served, *watch) as stranger, served.client() as client:
        assert stranger.recv(15) == b"HTTP/1.1 200 OK"
        while served.ask("GET", "/api/events", token=False)[0] != 429:
            pass
        with client.events("goal"):
            assert served.ask("GET", "/api/events")[0] == 429


def test_a_list_of_goals_has_an_end(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "LISTED", 2)
    served = serve()
    with served.client() as client:
        assert all(client.run(11).success for _ in range(3))
        listed = served.ask("GET", "/api/goals")[1]["goals"]
        known = [goal.identity for goal in served.executive.goals()]
    assert [goal["goal_id"] for goal in listed] == known[-2:]


def test_a_watcher_who_reads_nothing_is_dropped(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hub, "MOST_WAITING", 100_000)
    monkeypatch.setattr(connections, "STALL_SECONDS", 0.2)
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.2)
    monkeypatch.setattr(api, "MOST_WATCHERS", 2)
    served = serve()
    with (
        served.client() as client,
        client.events("log") as events,
        raw(served, "GET /api/events HTTP/1.1", *head(served, "")[1:]) as deaf,
    ):
        assert deaf.recv(15) == b"HTTP/1.1 200 OK"
        for number in range(200):
            line = logs.LogLine(served.clock.now(), 20, "test", f"{number} {'x' * 10_000}")
            served.executive.tell(line)
            assert next(events).message.startswith(f"{number} ")  # type: ignore[union-attr]
        assert b"".join(iter(lambda: deaf.recv(65_536), b"")).count(b"\n\n") < 200
        assert client.run(11).success


def test_where_it_may_not_listen(serve: Serve) -> None:
    served = serve()
    with pytest.raises(AddressInUse, match="--tcp-port"):
        serve(port=served.server.port)
    with pytest.raises(ServerError, match="--expose"):
        serve(address="0.0.0.0")
    with pytest.raises(ServerError, match="rosbridge"):
        serve(address="0.0.0.0", expose=True, rosbridge=True)
    with pytest.raises(ServerError, match="no address"):
        serve(address="localhost")


@pytest.mark.parametrize(
    "page", ["*", "null", "friend.example", "http://friend.example/", "HTTP://x", "http://x y", ""]
)
def test_an_origin_that_no_browser_would_name(serve: Serve, page: str) -> None:
    with pytest.raises(ServerError, match="no origin, such as http://name:port"):
        serve(origins=("http://friend.example:8080", page))


def test_the_token_is_its_users_alone(serve: Serve, tmp_path: Path) -> None:
    served = serve()
    file = access.file_of(served.server.port)
    assert file.parent.parent == tmp_path
    assert (file.stat().st_mode & 0o777, file.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    assert access.read(served.server.port).token == served.server.token  # type: ignore[union-attr]
    other = serve()
    assert other.server.token != served.server.token
    file.parent.chmod(0o755)
    with pytest.raises(ServerError, match="chmod 700"):
        serve()
    file.parent.chmod(0o700)


def test_the_token_is_in_no_recording(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        outcome = client.run(11)
    served.executive.close()
    assert served.server.token.encode() not in Path(outcome.recording).read_bytes()


def test_an_arm_that_is_unplugged_is_still_answered_for(serve: Serve) -> None:
    served = serve()
    with served.client() as client, client.events("sent") as frames:
        goal = client.send(1)
        next(frames)
        served.link.unplug()
        assert client.result(goal, 5.0).code == "hw.port_lost"
    assert stops(served)
