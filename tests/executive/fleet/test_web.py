"""The page of a fleet: what it serves, and what a browser shows of it."""

from collections.abc import Iterator

import pytest
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient

from executive.fleet import web
from executive.fleet.connection import GONE
from executive.fleet.fleet_client import ArmRow
from executive.fleet.values import Member, Presence

ROWS = [
    ArmRow(
        Member("bench.arm-7", "http://arm:8765", "lab", "b" * 32, 1),
        Presence("b" * 32, "busy", "a" * 32, "ok", 3),
    ),
    ArmRow(Member("bench.<b>", "javascript:alert(1)", "lab", "c" * 32, 1), None),
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

    async def queued(self, most: int) -> tuple[int, list[object]]:
        return 4, []


@pytest.fixture
def stored() -> Stored:
    return Stored()


@pytest.fixture
def browser(stored: Stored) -> Iterator[TestClient]:
    app = web.make_app(stored, stored)  # type: ignore[arg-type]
    with TestClient(app, base_url="http://127.0.0.1") as client:
        yield client


def test_the_page_its_arms_and_its_files(browser: TestClient) -> None:
    found = browser.get("/arms").json()
    assert found["queued"] == 4
    assert [each["state"] for each in found["arms"]] == ["busy", "gone"]
    assert found["arms"][0]["url"] == "http://arm:8765"
    for path, kind in (("/", "text/html"), ("/fleet.js", "javascript"), ("/fleet.css", "text/css")):
        answer = browser.get(path)
        assert kind in answer.headers["content-type"]
        assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert browser.get("/../web.py").status_code == 404
    assert browser.get("/arms", headers={"host": "evil.example"}).status_code == 400
    assert browser.post("/arms").status_code == 405


def test_the_figures_are_those_of_prometheus(browser: TestClient) -> None:
    by = ("pool", "state", "code")
    families = text_string_to_metric_families(browser.get("/metrics").text)
    figures = {
        (sample.name, *map(sample.labels.get, by)): sample.value
        for family in families
        for sample in family.samples
    }
    assert figures == {
        ("armtree_fleet_arms", "bench", "busy", None): 1,
        ("armtree_fleet_arms", "bench", "gone", None): 1,
        ("armtree_fleet_jobs_queued", None, None, None): 4,
        ("armtree_fleet_jobs_claimed", None, None, None): 1,
        ("armtree_fleet_jobs_ended_total", "bench", "SUCCEEDED", "ok"): 2,
        ("armtree_fleet_jobs_ended_total", "bench", "ABORTED", "fleet.arm_lost"): 1,
    }


def test_a_fleet_that_does_not_answer_is_named(browser: TestClient, stored: Stored) -> None:
    for stored.error in (GONE[0](), TimeoutError("too slow")):
        answer = browser.get("/arms")
        assert answer.status_code == 503
        assert "NATS server does not answer" in answer.text
