"""Links that sign a browser in."""

import pytest

from executive.errors import WrongCode
from executive.server.sign_in import MAX_CODES, SignIn
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]


def code_in(link: str) -> str:
    return link.partition("#code=")[2]


def test_a_link_works_once() -> None:
    sign_in = SignIn("http://127.0.0.1:8765", "the-token")
    link, other = sign_in.link(), sign_in.link()
    assert link.startswith("http://127.0.0.1:8765/#code=")
    assert link != other
    assert sign_in.redeem(code_in(link)) == "the-token"
    for wrong in (code_in(link), "", "é", code_in(other)[:-1]):
        with pytest.raises(WrongCode):
            sign_in.redeem(wrong)
    assert sign_in.redeem(code_in(other)) == "the-token"


def test_the_oldest_unused_links_stop_working() -> None:
    sign_in = SignIn("http://127.0.0.1:8765", "the-token")
    links = [sign_in.link() for _ in range(MAX_CODES + 1)]
    with pytest.raises(WrongCode):
        sign_in.redeem(code_in(links[0]))
    assert sign_in.redeem(code_in(links[1])) == "the-token"


def test_the_server_exchanges_a_code_for_its_token(serve: Serve) -> None:
    served = serve(active=False)
    with served.client() as client:
        link = client.page_link()
    body = {"code": code_in(link)}
    assert served.ask("POST", "/api/session", body, token=False) == (
        200,
        {"token": served.server.token},
    )
    status, error = served.ask("POST", "/api/session", body, token=False)
    assert (status, error["code"]) == (401, "request.code")
    assert served.ask("GET", "/api/session") == (200, {"ok": True})
    assert served.ask("POST", "/api/links", {}, token=False)[0] == 401
