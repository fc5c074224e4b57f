"""Stops that are answered without the application: which ones, and as it would answer them."""

import contextlib
import http.client

import pytest

from executive.server.limits.quick_stop import QuickStop
from executive.server.security import AccessRules
from tests.support.servers.foreign_clients import answer, raw
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]

RULES = AccessRules(frozenset({"here"}), frozenset({"http://here"}), "token", False)
STOP, HOST = "POST /api/stop HTTP/1.1", "Host: here"


def data(*lines: str, body: str = "") -> bytes:
    return ("".join(f"{line}\r\n" for line in lines) + f"\r\n{body}").encode("latin-1")


@pytest.mark.parametrize(
    ("given", "keeps"),
    [
        (data(STOP, HOST), True),
        (data("POST /api/stop/ HTTP/1.1", HOST), True),
        (data("POST /api/stop?now=1 HTTP/1.1", HOST), True),
        (data(STOP, "host:here ", "x:", "Y: \xe9"), True),
        (data(STOP, HOST, "Connection: Keep-Alive"), True),
        (data(STOP, HOST, *["a:"] * 28), True),
        (data(STOP, HOST, "Connection: close"), False),
        (data(STOP, HOST, "Content-Length: 0"), True),
        (data(STOP, HOST, "Content-Length: 4", body="what"), True),
        (data(STOP, HOST, body="GET / HTTP/1.1\r\n"), False),
        (2 * data(STOP, HOST), False),
    ],
)
def test_a_whole_stop_is_found(given: bytes, keeps: bool) -> None:
    stop = QuickStop.find(given, RULES)
    assert stop is not None
    assert stop.keeps is keeps


@pytest.mark.parametrize(
    "given",
    [
        b"",
        data(STOP),
        data(STOP, HOST)[:-2],
        data(STOP, "Host: there"),
        data(STOP, HOST, HOST),
        data(STOP, HOST, "Origin: http://there"),
        data(STOP, HOST, "Content-Length: 5", body="what"),
        data(STOP, HOST, "Content-Length: 0", "Content-Length: 0"),
        data(STOP, HOST, "Content-Length: -1"),
        data(STOP, HOST, f"Content-Length: {'9' * 5000}"),
        data(STOP, HOST, "Transfer-Encoding: chunked", body="0\r\n\r\n"),
        data(STOP, HOST, " folded"),
        data(STOP, HOST, "a b: c"),
        data(STOP, HOST, "a: \0"),
        data(STOP, HOST, *(f"a{number}: b" for number in range(300))),
        data(STOP, HOST, *["a:"] * 29),
        data("POST /api/stop HTTP/1.0", HOST),
        data("POST /api/stop/x HTTP/1.1", HOST),
        data("POST /api/stopp HTTP/1.1", HOST),
        data("POST /api/stop?\0 HTTP/1.1", HOST),
        data("GET /api/stop HTTP/1.1", HOST),
    ],
)
def test_anything_else_waits_in_line(given: bytes) -> None:
    assert QuickStop.find(given, RULES) is None


@pytest.mark.parametrize("more", [[], ["origin: http://127.0.0.1:{port}"]])
def test_it_is_answered_as_by_the_application(serve: Serve, more: list[str]) -> None:
    served = serve()
    port = served.server.port
    lines = [STOP, f"host: 127.0.0.1:{port}", "connection: close", *more]
    whole = data(*(line.format(port=port) for line in lines))
    answers = []
    for pieces in ([whole], [whole[:9], whole[9:]]):
        with raw(served) as connection:
            for piece in pieces:
                connection.sendall(piece)
                served.ask("GET", "/api/health")  # the piece has arrived
            head, _, body = answer(connection).partition(b"\r\n\r\n")
            status, *headers = head.split(b"\r\n")
            answers.append((status, sorted(line.lower() for line in headers), body))
    assert answers[0] == answers[1]
    assert answers[0][0] == b"HTTP/1.1 200 OK"


@pytest.mark.parametrize(
    ("more", "status"),
    [
        (["a:"] * 90, b"200"),
        (["a:"] * 110, b"400"),
        ([f"a: {'b' * 7900}"], b"200"),
        ([f"a: {'b' * 8150}"], b"400"),
    ],
)
def test_a_long_head_waits_in_line_and_has_limits(
    serve: Serve, more: list[str], status: bytes
) -> None:
    served = serve()
    with raw(served) as connection:
        host = f"host: 127.0.0.1:{served.server.port}"
        connection.sendall(data(STOP, host, "connection: close", *more))
        assert answer(connection).startswith(b"HTTP/1.1 " + status)


def test_a_connection_is_used_again_after_a_stop(serve: Serve) -> None:
    served = serve()
    connection = http.client.HTTPConnection("127.0.0.1", served.server.port, timeout=10)
    with contextlib.closing(connection):
        for method, path in (("GET", "/api/health"), *2 * [("POST", "/api/stop")]) * 2:
            connection.request(method, path)
            own = connection.sock
            with connection.getresponse() as response:
                assert response.status == 200
                response.read()
            assert connection.sock is own
    assert served.executive.status().stops == 4  # a program that watches sees each, also when idle
    served.executive.cancel("f" * 32)
    assert served.executive.status().stops == 4


def test_of_many_stops_at_once_the_first_is_answered(serve: Serve) -> None:
    served = serve()
    goal = served.executive.send(10).identity
    with raw(served) as connection:
        connection.sendall(20 * data(STOP, f"host: 127.0.0.1:{served.server.port}"))
        found = answer(connection)
    assert found.count(b"HTTP/1.1") == 1
    assert goal.encode() in found


def test_a_bug_costs_the_answer_and_not_the_server(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve()

    def fail(*arguments: object) -> None:
        raise ZeroDivisionError("test")

    stop = data(STOP, f"host: 127.0.0.1:{served.server.port}", "connection: close")
    for bug, status in ((True, b"500 Internal Server Error"), (False, b"200 OK")):
        with monkeypatch.context() as patch, raw(served) as connection:
            if bug:
                patch.setattr(served.executive, "cancel", fail)
            connection.sendall(stop)
            assert answer(connection).startswith(b"HTTP/1.1 " + status)
