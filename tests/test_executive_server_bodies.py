"""Bodies and parameters of strangers: wrong ones, large ones, and those that no stop minds."""

import json

import pytest

from tests.serving import Serve

pytest_plugins = ["tests.server_fixtures"]

GOAL = "0123456789abcdef" * 2


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
    assert served.ask("POST", "/api/goals", KEYS, token=False)[0] == 401


def test_an_error_quotes_only_so_much_of_what_was_sent(serve: Serve) -> None:
    served = serve()
    for body in (
        KEYS,
        b'{"task": "' + b"x" * 60_000 + b'"}',
        b'{"%s":1,"%s":1}' % (2 * (b"x" * 9_000,)),
    ):
        status, error = served.ask("POST", "/api/goals", body)
        assert status in (400, 422)
        assert len(json.dumps(error)) < 600


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
def test_nothing_but_its_source_keeps_a_stop_from_being_done(
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
