"""Hostile clients: foreign pages, invalid bodies, slow senders. A stop is always answered."""

import contextlib
import dataclasses
import json
import logging
import subprocess
import sys
from pathlib import Path

import pytest
from websockets.frames import Close, Frame, Opcode

from executive.api import token_file
from executive.api.operations import OPERATIONS, Access
from executive.client import transport
from executive.errors import AddressInUse, ServerError
from executive.server.http import app
from executive.server.limits import connections
from tests.support.servers.foreign_clients import GOAL, UPGRADE, answer, head, raw, stops
from tests.support.servers.serving import Serve

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]


OTHERS = {"question_id": "01234567", "task": 0, "digest": "0" * 32, "name": "run.mcap"}


def path_of(template: str, goal: str = GOAL, transition: str = "configure") -> str:
    return template.format(goal_id=goal, transition=transition, **OTHERS)


def test_only_a_stop_needs_no_token(serve: Serve) -> None:
    served = serve()
    for operation in OPERATIONS.values():
        if operation.access in (Access.READ, Access.SIGN_IN):
            continue
        method, path = operation.method, path_of(operation.path)
        status, error = served.ask(method, path, token=False)
        assert (status != 401) == operation.stops, operation.path
        if not operation.stops:
            assert error["code"] == "request.token"
            wrong = {"authorization": "Bearer x"}
            assert served.ask(method, path, {}, wrong)[0] == 401
    assert served.executive.goals() == ()


def test_an_exposed_server_needs_the_token_for_reading(serve: Serve) -> None:
    served = serve(expose=True)
    for operation in OPERATIONS.values():
        status = served.ask(operation.method, path_of(operation.path), token=False)[0]
        open_to_all = operation.stops or operation.access is Access.SIGN_IN
        assert (status == 401) != open_to_all, operation.path
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
    for operation in OPERATIONS.values():
        path = path_of(operation.path, goal, "deactivate")
        status, error = served.ask(operation.method, path, headers=headers)
        assert (status, error["code"].partition(".")[0]) == (403, "request")
    assert served.executive.goals()[0].outcome is None
    assert served.executive.status().arm.value == "active"


@pytest.mark.parametrize(
    ("body", "kind", "status"),
    [
        (b'{"task": NaN}', "application/json", 400),
        (b'{"task": 1e999}', "application/json", 400),
        (b'{"task": 11, "task": 10}', "application/json", 400),
        (b'{"task": 11', "application/json", 400),
        (b"\xff", "application/json", 400),
        (b"[" * 60_000, "application/json", 400),
        (b"[]", "application/json", 422),
        (b"{}", "application/json", 422),
        (b'{"task": true}', "application/json", 422),
        (b'{"task": -1}', "application/json", 422),
        (b'{"task": 2147483648}', "application/json", 422),
        (b'{"task": "11"}', "application/json", 422),
        (b'{"task": 11, "speed": 1}', "application/json", 422),
        (b'{"task": 11, "arguments": {"a": null}}', "application/json", 422),
        (b'{"task": 11}', "text/plain", 415),
        (b'{"task": 11}', "application/x-www-form-urlencoded", 415),
        (b'{"task": 11}', "application/json; charset=utf-16", 415),
        (b'{"task": 11, "x": "' + b"x" * 70_000 + b'"}', "application/json", 413),
    ],
)
def test_bad_bodies(serve: Serve, body: bytes, kind: str, status: int) -> None:
    served = serve()
    found, error = served.ask("POST", "/api/goals", body, {"content-type": kind})
    assert found == status
    assert error["code"].startswith("request.")
    assert served.executive.goals() == ()


KEYS = b"{" + b",".join(b'"%d":1' % number for number in range(6500)) + b"}"


def test_a_large_body_of_a_stranger_is_refused_before_it_is_read(serve: Serve) -> None:
    served = serve()
    for path in ("/api/cancel", f"/api/goals/{GOAL}/cancel"):
        status, error = served.ask("POST", path, KEYS, token=False)
        assert (status, error["code"]) == (413, "request.too_large"), path
        assert served.ask("POST", path, KEYS)[0] == 422, path
    assert served.ask("POST", "/api/goals", KEYS, token=False)[0] == 401


def test_a_large_body_is_answered_and_its_connection_not_reset(serve: Serve) -> None:
    served = serve()
    _, host, _, *more = head(served, "content-length: 10000", "", "")
    lines = ("POST /api/cancel HTTP/1.1", host, *more)
    with raw(served) as connection:
        connection.sendall("\r\n".join(lines).encode() + b"x" * 10_000)
        found = b"".join(iter(lambda: connection.recv(65_536), b""))
    assert found.startswith(b"HTTP/1.1 413")


def test_an_error_is_short(serve: Serve) -> None:
    served = serve()
    for body in (
        KEYS,
        b'{"task": "' + b"x" * 60_000 + b'"}',
        b'{"%s":1,"%s":1}' % (2 * (b"x" * 9_000,)),
    ):
        status, error = served.ask("POST", "/api/goals", body)
        assert status in (400, 422)
        assert len(json.dumps(error)) < 600
    for argument in ({"x" * 60_000: 1}, {"speed": "!" + "x" * 60_000}):
        status, error = served.ask("POST", "/api/goals", {"task": 11, "arguments": argument})
        assert status == 409
        assert len(json.dumps(error)) < 2500
    long = "x" * 6_000
    for path, headers in (
        (f"/api/{long}", {}),
        (f"/api/goals?{long}=1", {}),
        ("/api/goals", {"origin": long}),
        ("/api/goals", {"host": long}),
    ):
        assert len(json.dumps(served.ask("GET", path, headers=headers)[1])) < 600


@pytest.mark.parametrize(
    ("path", "body", "kind"),
    [
        ("/api/stop", b"", "application/x-www-form-urlencoded"),
        ("/api/stop", b"", "text/plain"),
        ("/api/stop/", b"", "text/plain"),
        ("/api/stop?now=1", b"{}", "application/json"),
        ("/api/stop", b"what", "text/plain"),
        ("/api/stop", KEYS, "application/json"),
        ("/api/stop", b"x" * 70_000, "application/json"),
        ("/api/cancel", b"", "application/x-www-form-urlencoded"),
    ],
)
def test_only_a_wrong_source_prevents_a_stop(
    serve: Serve, path: str, body: bytes, kind: str
) -> None:
    served = serve()
    goal = served.executive.send(10).identity
    status, answer = served.ask("POST", path, body, {"content-type": kind}, token=False)
    assert (status, answer) == (200, {"return_code": 0, "goals": [goal]})


@pytest.mark.parametrize(
    "query", ["timeout=x", "timeout=-1", "timeout=NaN", "timeout=1e9", "timeout=1&timeout=1", "a=1"]
)
def test_bad_parameters(serve: Serve, query: str) -> None:
    status, error = serve().ask("GET", f"/api/goals/{GOAL}/result?{query}")
    assert (status in (400, 422), error["code"]) == (True, "request.malformed")


def test_invalid_http_is_answered_and_closed(serve: Serve) -> None:
    served = serve()
    many, long = "a: b\r\n" * 101, f"a: {'b' * 10_000}\r\n"
    own = f"host: 127.0.0.1:{served.server.port}"
    invalid = ("\x16\x03\x01\x02", "GET", "GET / HTTP/1.1", "A" * 100_000)
    for nonsense in (*invalid, *(f"GET / HTTP/1.1\r\n{own}\r\n{each}" for each in (many, long))):
        with raw(served, nonsense, "", "") as connection:
            said = answer(connection)
            assert said.startswith(b"HTTP/1.1 400")
            assert json.loads(said.partition(b"\r\n\r\n")[2])["code"] == "request.malformed"
    assert stops(served)


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


def test_a_slow_body_times_out(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(app, "BODY_SECONDS", 0.1)
    served = serve()
    with raw(served, *head(served, "content-length: 100", "")) as connection:
        connection.sendall(b"{")
        assert b" 408 " in answer(connection)


def test_a_slow_head_times_out(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.1)
    served = serve()
    with raw(served, "GET /api/health HTTP/1.1") as connection:
        assert answer(connection) == b""
    # the next request on a connection times out as well
    with raw(served, "GET /api/health HTTP/1.1", *head(served, "")[1:]) as connection:
        connection.sendall(b"GET ")
        assert answer(connection).count(b"HTTP/1.1 200") == 1


def test_pipelined_requests_are_not_answered(serve: Serve) -> None:
    served = serve()
    ask = ("GET /api/health HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "")
    with raw(served, *ask * 8) as connection:
        assert answer(connection).count(b"HTTP/1.1 200") == 1


def test_text_that_is_not_utf_8_ends_its_connection_and_fills_no_log(
    serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    served = serve(rosbridge=True)
    asks = ("GET / HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", *UPGRADE, "")
    halves = Frame(Opcode.TEXT, b"\xff", fin=False), Frame(Opcode.CONT, b"\xfe")
    for frames in ((Frame(Opcode.TEXT, b"\xff\xfe"),) * 2, halves):
        with raw(served, *asks) as connection:
            assert b" 101 " in connection.recv(1000)
            connection.sendall(b"".join(each.serialize(mask=True) for each in frames))
            assert answer(connection) == Frame(Opcode.CLOSE, Close(1007, "").serialize()).serialize(
                mask=False
            )
    assert [each.message for each in caplog.records if each.levelno > logging.INFO] == []


def test_unsafe_and_invalid_addresses(serve: Serve) -> None:
    served = serve()
    with pytest.raises(AddressInUse, match="--tcp-port"):
        serve(port=served.server.port)
    with pytest.raises(ServerError, match="--expose"):
        serve(address="0.0.0.0")
    with pytest.raises(ServerError, match="rosbridge"):
        serve(address="0.0.0.0", expose=True, rosbridge=True)
    with pytest.raises(ServerError, match="is not an address"):
        serve(address="localhost")


@pytest.mark.parametrize(
    "page", ["*", "null", "friend.example", "http://friend.example/", "HTTP://x", "http://x y", ""]
)
def test_an_origin_that_browsers_do_not_send(serve: Serve, page: str) -> None:
    with pytest.raises(ServerError, match="is not an origin, such as http://name:port"):
        serve(origins=("http://friend.example:8080", page))


def test_only_the_user_can_read_the_token(serve: Serve, tmp_path: Path) -> None:
    served = serve()
    file = token_file.file_of(served.server.port)
    assert file.parent.parent == tmp_path
    assert (file.stat().st_mode & 0o777, file.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    assert token_file.read(served.server.port).token == served.server.token  # type: ignore[union-attr]
    other = serve()
    assert other.server.token != served.server.token
    file.parent.chmod(0o755)
    with pytest.raises(ServerError, match="chmod 700"):
        serve()
    file.parent.chmod(0o700)


def test_the_token_of_a_killed_server_is_not_used(serve: Serve) -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        pass
    file = token_file.file_of(serve().server.port)
    left = token_file.ServerInfo("http://127.0.0.1:1", "secret", gone.pid)
    file.with_name("server-1.json").write_text(json.dumps(dataclasses.asdict(left)))
    assert "authorization" not in transport.Address.find(left.url, None).headers
    serve()
    assert not token_file.file_of(1).exists()
    assert file.exists()


def test_the_token_is_in_no_recording(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        outcome = client.run(11)
    served.executive.close()
    assert served.server.token.encode() not in Path(outcome.recording).read_bytes()


def test_the_server_answers_when_the_arm_is_unplugged(serve: Serve) -> None:
    served = serve()
    with served.client() as client, client.events("sent") as frames:
        goal = client.send(1)
        next(frames)
        served.link.unplug()
        assert client.result(goal, 5.0).code == "hw.port_lost"
    assert stops(served)


def test_a_target_may_be_a_whole_url(serve: Serve) -> None:
    """Clients send it to a proxy."""
    served = serve()
    own = f"127.0.0.1:{served.server.port}"

    def asked(target: str) -> bytes:
        lines = (f"POST {target} HTTP/1.1", f"host: {own}", "connection: close", "", "")
        with raw(served, *lines[:-1]) as connection:
            return answer(connection)

    goal = served.executive.send(10).identity
    assert goal.encode() in asked(f"http://{own}/api/stop")
    assert asked(f"HTTP://{own}/api/cancel?").startswith(b"HTTP/1.1 200")
    foreign = asked("http://evil.example/api/stop")
    assert foreign.startswith(b"HTTP/1.1 403")
    assert b'"request.host"' in foreign
    assert asked(f"http://{own}").startswith(b"HTTP/1.1 405")
    assert asked("*").startswith(b"HTTP/1.1 404")
