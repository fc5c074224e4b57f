"""The page of a fleet: what it serves, and what a browser shows of it."""

import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import uvicorn
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient

from executive.fleet import web
from executive.fleet.connection import GONE
from executive.fleet.errors import NotStarted
from executive.fleet.fleet_client import ArmRow
from executive.fleet.values import Member, Presence
from tests.support.servers.browsing import is_accessible, shows

pytest_plugins = ["tests.support.servers.browser_fixtures"]

ROWS = [
    ArmRow(
        Member("bench.arm-7", "http://arm:8765", "lab", "b" * 32, 1),
        Presence("b" * 32, "busy", "a" * 32, "ok", 3),
    ),
    ArmRow(Member("bench.<b>", "javascript:alert(1)", "lab", "c" * 32, 1), None),
    ArmRow(Member("bench.far", "http://127.0.0.1:8765", "lab", "d" * 32, 1), None),
    ArmRow(Member("bench.near", "http://[::1]:8765", socket.gethostname(), "e" * 32, 1), None),
]


class Stored:
    """What a client of a fleet and its supervisor return."""

    claimed = 1
    ended = {("bench", "SUCCEEDED", "ok"): 2, ("bench", "ABORTED", "fleet.arm_lost"): 1}
    error: Exception | None = None

    async def arms(self) -> list[ArmRow]:
        if self.error:
            raise self.error
        return ROWS

    async def pools(self) -> dict[str, int]:
        return {"bench": 1, "paint": 3}

    async def queued(self, most: int) -> tuple[int, list[object]]:
        return 4, []


@pytest.fixture
def stored() -> Stored:
    return Stored()


@pytest.fixture
def requests(stored: Stored) -> Iterator[TestClient]:
    app = web.make_app(stored, stored)  # type: ignore[arg-type]
    with TestClient(app, base_url="http://127.0.0.1") as client:
        yield client


def test_the_page_its_arms_and_its_files(requests: TestClient) -> None:
    found = requests.get("/arms").json()
    assert (found["queued"], found["host"]) == (4, socket.gethostname())
    assert found["waiting"] == ["no arm of paint is ready: none has joined; 3 jobs wait"]
    assert [each["state"] for each in found["arms"]] == ["busy", *["gone"] * 3]
    assert found["arms"][0]["url"] == "http://arm:8765"
    for path, kind in (("/", "text/html"), ("/fleet.js", "javascript"), ("/fleet.css", "text/css")):
        answer = requests.get(path)
        assert kind in answer.headers["content-type"]
        assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert requests.get("/../web.py").status_code == 404
    assert requests.get("/arms", headers={"host": "evil.example"}).status_code == 400
    assert requests.post("/arms").status_code == 405


def test_the_figures_are_those_of_prometheus(requests: TestClient) -> None:
    by = ("pool", "state", "code")
    families = text_string_to_metric_families(requests.get("/metrics").text)
    figures = {
        (sample.name, *map(sample.labels.get, by)): sample.value
        for family in families
        for sample in family.samples
    }
    assert figures == {
        ("armtree_fleet_arms", "bench", "busy", None): 1,
        ("armtree_fleet_arms", "bench", "gone", None): 3,
        ("armtree_fleet_jobs_queued", None, None, None): 4,
        ("armtree_fleet_jobs_claimed", None, None, None): 1,
        ("armtree_fleet_jobs_ended_total", "bench", "SUCCEEDED", "ok"): 2,
        ("armtree_fleet_jobs_ended_total", "bench", "ABORTED", "fleet.arm_lost"): 1,
    }


def test_a_fleet_that_does_not_answer_is_named(requests: TestClient, stored: Stored) -> None:
    for stored.error in (GONE[0](), TimeoutError("too slow")):
        answer = requests.get("/arms")
        assert answer.status_code == 503
        assert "NATS server does not answer" in answer.text


def test_a_port_that_is_used_is_named_once() -> None:
    used = pytest.raises(NotStarted, match=r"\d: Address already in use; ")
    with web.listen(0) as listener, used:
        web.listen(listener.getsockname()[1])


@pytest.fixture
def page(stored: Stored) -> Iterator[str]:
    """The URL of the page of `stored`."""
    app = web.make_app(stored, stored)  # type: ignore[arg-type]
    config = uvicorn.Config(app, lifespan="off", log_config=None, timeout_graceful_shutdown=1)
    server, listener = uvicorn.Server(config), web.listen(0)
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    server.should_exit = True
    thread.join()


@pytest.mark.slow
def test_a_browser_shows_the_arms_and_links_to_pages_that_it_can_reach(
    page: str, stored: Stored, browser: Any
) -> None:
    problems: list[str] = []
    tab = browser.new_page()
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.goto(page)
    shows(tab, "#summary", "^4 arms: 1 busy, 3 gone; 4 jobs queued$")
    shows(tab, "#waiting", "^no arm of paint is ready: none has joined; 3 jobs wait$")
    assert [each.inner_text() for each in tab.locator("#arms tr").first.locator("td").all()] == [
        *("bench.arm-7", "busy", "a" * 32, "ok", "3", "lab")
    ]
    links = tab.eval_on_selector_all("#arms a", "all => all.map(a => [a.textContent, a.href])")
    assert links == [["bench.arm-7", "http://arm:8765/"], ["bench.near", "http://[::1]:8765/"]]
    assert tab.locator("#arms td", has_text="bench.<b>").get_attribute("title")
    far = tab.locator("#arms td", has_text="bench.far").get_attribute("title")
    assert "its page is only on lab; armtree serve --bind 0.0.0.0 --expose --host lab" in far
    is_accessible(tab)
    stored.error = TimeoutError("too slow")
    shows(tab, "#summary", "^The list is old: the NATS server does not answer: too slow$")
    stored.error = None
    shows(tab, "#summary", "^4 arms")
    tab.close()
    assert problems == []
