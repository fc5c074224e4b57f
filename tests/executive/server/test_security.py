"""Who may call and how often, without a socket if possible."""

import pytest
from starlette.datastructures import Headers

from executive.errors import RequestError
from executive.server.security import AccessRules, host_names, is_loopback
from executive.server.server import ListenOptions
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]

RULES = AccessRules(
    host_names(("127.0.0.1", "localhost", "::1"), 8765),
    frozenset({"http://127.0.0.1:8765"}),
    "the-token",
    exposed=False,
)


def headers(*lines: tuple[str, str]) -> Headers:
    return Headers(raw=[(name.encode(), value.encode("latin-1")) for name, value in lines])


def refused(*lines: tuple[str, str]) -> str:
    try:
        RULES.check_source(headers(*lines))
    except RequestError as error:
        return error.code
    return ""


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8765", "localhost:8765", "LOCALHOST:8765", "[::1]:8765"]
)
def test_names_of_the_server_are_accepted(host: str) -> None:
    assert refused(("host", host)) == ""
    assert refused(("host", host), ("origin", "http://127.0.0.1:8765")) == ""


@pytest.mark.parametrize(
    "host",
    ["", "127.0.0.1", "127.0.0.1:8766", "evil.example:8765", "localhost.:8765", " localhost:8765",
     "127.0.0.1:8765.evil.example", "user@127.0.0.1:8765", "127.1:8765", "0.0.0.0:8765"],
)  # fmt: skip
def test_another_host_is_refused(host: str) -> None:
    assert refused(("host", host)) == "request.host"


@pytest.mark.parametrize(
    ("options", "page"),
    [
        (ListenOptions(), "http://127.0.0.1:8765"),
        (ListenOptions("::", expose=True), "http://[::1]:8765"),
        (ListenOptions("192.0.2.7", expose=True), "http://192.0.2.7:8765"),
        (ListenOptions("0.0.0.0", hosts=("arm-7", "b"), expose=True), "http://arm-7:8765"),
        (
            ListenOptions(hosts=("Robot.Example",), origins=("http://b", "https://robot.example")),
            "https://robot.example",
        ),
    ],
)
def test_the_page_has_a_url_for_other_machines(options: ListenOptions, page: str) -> None:
    assert options.page(8765) == page


def test_port_80_may_be_left_out() -> None:
    assert host_names(("localhost", "::1"), 80) == {
        "localhost",
        "localhost:80",
        "[::1]",
        "[::1]:80",
    }


def test_a_name_with_a_port_is_kept() -> None:
    given = ("Robot.Example:8443", "[::1]:8443", "[::1]")
    assert host_names(given, 8765) == {"robot.example:8443", "[::1]:8443", "[::1]:8765"}


def test_behind_a_proxy_host_is_the_configured_name(serve: Serve) -> None:
    served = serve(active=False, hosts=("Robot.Example", "robot.example:8443"))
    port, status = served.server.port, "/api/status"
    for host in ("robot.example", f"robot.example:{port}", "robot.example:8443"):
        assert served.ask("GET", status, headers={"host": host})[0] == 200
    for host in ("127.0.0.1", "robot.example:443", "evil.example"):
        refused, reported = served.ask("GET", status, headers={"host": host})
        assert (refused, reported["code"]) == (403, "request.host")
    # Another server may run on this machine; its pages are foreign.
    for page in ("http://robot.example", "https://robot.example"):
        reported = served.ask("GET", status, headers={"origin": page})[1]
        assert reported["code"] == "request.origin"


def test_a_missing_or_doubled_host_is_refused() -> None:
    assert refused() == "request.host"
    assert refused(("host", "localhost:8765"), ("host", "localhost:8765")) == "request.host"


@pytest.mark.parametrize(
    "origin",
    ["null", "http://evil.example", "http://127.0.0.1", "https://127.0.0.1:8765", "",
     "http://127.0.0.1:8765/", "http://localhost:8765", "HTTP://127.0.0.1:8765"],
)  # fmt: skip
def test_another_origin_is_refused(origin: str) -> None:
    assert refused(("host", "localhost:8765"), ("origin", origin)) == "request.origin"


def test_two_origins_are_refused() -> None:
    ours = ("origin", "http://127.0.0.1:8765")
    assert refused(("host", "localhost:8765"), ours, ours) == "request.origin"


@pytest.mark.parametrize(
    "value",
    ["", "the-token", "Bearer", "Bearer ", "Bearer the-toke", "Bearer the-token2",
     "Basic the-token", "Bearer thé-token"],
)  # fmt: skip
def test_a_wrong_token_is_refused(value: str) -> None:
    with pytest.raises(RequestError, match="token") as caught:
        RULES.check_token(headers(("authorization", value)))
    assert caught.value.http_status == 401
    assert "the-token" not in str(caught.value)


def test_the_token_passes() -> None:
    RULES.check_token(headers(("authorization", "Bearer the-token")))
    RULES.check_token(headers(("authorization", "bearer the-token")))


def test_loopback_addresses() -> None:
    assert [is_loopback(a) for a in ("127.0.0.1", "127.8.8.8", "::1")] == [True] * 3
    assert [is_loopback(a) for a in ("0.0.0.0", "::", "192.168.0.1")] == [False] * 3
