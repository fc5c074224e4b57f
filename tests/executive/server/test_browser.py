"""Pages of other sites in a real browser: an accepted origin can use the server, others cannot."""

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Queue
from typing import Any
from urllib.parse import urlencode

import pytest

from tests.support.paths import PEERS
from tests.support.servers.serving import Serve, Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

PAGE = PEERS / "page.html"


class Site(ThreadingHTTPServer):
    """Serves the page, and receives its report."""

    def __init__(self) -> None:
        self.reported: Queue[dict[str, Any]] = Queue()
        super().__init__(("127.0.0.1", 0), _Handler)


class _Handler(BaseHTTPRequestHandler):
    server: Site

    def do_GET(self) -> None:
        self._answer(200 if self.path.startswith("/page?") else 404, PAGE.read_bytes())

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        self._answer(200, b"")
        self.server.reported.put(json.loads(body))

    def _answer(self, status: int, body: bytes) -> None:
        self.send_response(status)
        self.send_header("content-type", "text/html")
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002, as it is called
        """Log nothing."""


@pytest.fixture
def site() -> Iterator[Site]:
    with Site() as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def opened(browser: Any, site: Site, served: Served, host: str) -> dict[str, Any]:
    """The report of the page, opened under a name of its site."""
    facts = urlencode({"server": served.server.url, "token": served.server.token})
    with browser.new_context() as context:
        context.new_page().goto(f"http://{host}:{site.server_port}/page?{facts}")
        return site.reported.get(timeout=50)


def test_an_accepted_and_a_foreign_page(browser: Any, serve: Serve, site: Site) -> None:
    served = serve(rosbridge=True, origins=(f"http://localhost:{site.server_port}",))
    reported = opened(browser, site, served, "localhost")
    assert reported["stream"] == "open"
    assert reported["status"]["json"]["arm"] == "active"
    assert (reported["stranger"]["status"], reported["stranger"]["json"]["code"]) == (
        401,
        "request.token",
    )
    assert reported["send"]["status"] == 201
    assert reported["result"]["json"]["state"] == "SUCCEEDED"
    assert {"goal", "node", "status"} <= set(reported["events"])
    assert reported["stop"]["json"] == {"return_code": 0, "goals": []}
    assert reported["socket"] == "open"

    goal = served.executive.send(10).identity
    reported = opened(browser, site, served, "127.0.0.1")
    refused = {"error": "TypeError"}
    asked = ("status", "stranger", "send", "stop", "form")
    assert [reported[name] for name in asked] == [refused] * 5
    assert (reported["stream"], reported["events"], reported["socket"]) == (
        "refused",
        [],
        "refused",
    )
    assert [status.state.name for status in served.executive.goals()] == ["SUCCEEDED", "EXECUTING"]
    assert served.executive.status().goal.identity == goal  # type: ignore[union-attr]
