"""The header of the page in a browser: state, sign-in, STOP, and a lost connection."""

from typing import Any

import pytest

from tests.support.servers.browsing import Open, Tab, expect, forget, shows
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

GREY = "grayscale(1)"
WAIT = 10  # number of the task that waits for an hour


def test_the_header_shows_the_robot_the_arm_and_the_goal(
    open_page: Open, page_server: Served
) -> None:
    tab = open_page()
    shows(tab, "#robot", "^arduinobot$")
    shows(tab, "#arm-state", "^active$")
    page_server.executive.send(WAIT)
    shows(tab, "#goal-title", "^task 10 wait$")
    shows(tab, "#goal-state", "waiting")
    tab.reload()  # no event of the goal has a position
    shows(tab, "#positions", r"joint_1\s*0\.0°")
    assert tab.title() == "arduinobot, armtree"


def test_stop_works_without_sign_in_and_says_when_it_is_done(
    open_page: Open, page_server: Served
) -> None:
    tab = open_page(page_server.server.url)
    shows(tab, "#stop-note", "^software stop, not an emergency stop$")
    tab.emulate_media(forced_colors="active")  # leaves no background
    expect(tab, "#stop").not_to_have_css("border-top-color", "rgba(0, 0, 0, 0)")
    expect(tab, "#stop").to_have_css("border-top-style", "solid")
    tab.evaluate(
        "note = document.getElementById('stop-note'); said = [];"
        "new MutationObserver(() => said.push(note.textContent)).observe(note, {childList: true})"
    )
    height = "document.querySelector('header').offsetHeight"
    before = tab.evaluate(height)
    for keys in (["Tab", "Enter"], ["Escape"], []):  # STOP is the first in the order of tabs
        goal = page_server.executive.send(WAIT).identity
        shows(tab, "#running", "^wait$")
        tab.evaluate("said.length = 0")
        for key in keys:
            tab.keyboard.press(key)
        if not keys:
            tab.click("#stop")
        shows(tab, "#stop-note", "^stopped at .*software stop, not an emergency stop")
        assert tab.evaluate("said[0]").startswith("stopping…")
        assert page_server.executive.goal(goal).state.name == "CANCELED"
        shows(tab, "#goal-state", "^canceled$")
        assert tab.evaluate(height) == before  # nothing below it moves


def test_the_page_knows_of_its_stop_before_the_goals_have_ended(
    open_page: Open, page_server: Served
) -> None:
    def hold(_: Any) -> None:
        """Answer no request that would end with the goal."""

    def prepare(empty: Tab) -> None:
        empty.route("**/api/events", hold)
        empty.route("**/result?*", hold)

    tab = open_page(prepare=prepare)
    page_server.executive.send(WAIT)
    with tab.expect_response("**/api/status"):
        pass
    tab.evaluate(
        "setTimeout = () => 0; for (let timer = 0; timer < 1000; timer++) clearTimeout(timer)"
    )
    ended = list[str]()
    tab.on("requestfailed", lambda request: ended.append(request.url))
    with tab.expect_request("**/api/status"):
        tab.keyboard.press("Escape")
    assert not ended  # the page still waits for the goal


def test_an_old_status_does_not_undo_the_end_of_a_goal(open_page: Open) -> None:
    state = open_page().evaluate(
        """import('/page/model/run.js').then(({Run}) => {
          const run = new Run(), status = {goal_id: 'a', state: 'EXECUTING', result: null};
          run.update({event: 'goal', goal_id: 'a', task: 1, name: 'pick', time_s: 1, start: {}});
          run.update({...status, event: 'status', state: 'CANCELED', result: {state: 'CANCELED'}});
          run.updateGoal(status);
          return [run.state, run.active];
        })"""
    )
    assert state == ["CANCELED", False]


def test_a_link_signs_in_once_and_a_reload_stays_signed_in(
    open_page: Open, page_server: Served
) -> None:
    link = page_server.server.sign_in.link()
    tab = open_page(link)
    shows(tab, "#session", "^signed in$")
    assert "code" not in tab.url
    tab.reload()
    shows(tab, "#session", "^signed in$")
    assert tab.evaluate("document.cookie") == ""
    other = open_page(link)
    shows(other, "#sign-in-help", "this link is unknown, or was opened before.*armtree view")
    shows(other, "#session", "^watching only$")
    tab.evaluate("sessionStorage.setItem('armtree-token', 'of an earlier server')")
    tab.reload()
    shows(tab, "#session", "^watching only$")
    forget(tab, "401")


def test_a_lost_connection_greys_the_page_and_comes_back(open_page: Open) -> None:
    tab = open_page()
    shows(tab, "#arm-state", "^active$")
    tab.click("#stop")
    shows(tab, "#stop-note", "^stopped at")
    tab.context.set_offline(True)
    tab.fill("#runs-search", "a")
    shows(tab, "#runs-note", "^The server does not answer.$")
    shows(tab, "#connection", r"No connection for \d+ s")
    alarm = "STOP cannot reach the server. Switch the servo power off."
    assert tab.inner_text("#stop-note") == alarm  # not the answer to the stop before
    for part in ("main", "#player", ".facts"):
        assert tab.evaluate(f"getComputedStyle(document.querySelector('{part}')).filter") == GREY
    tab.click("#stop")
    expect(tab, "#stop.busy").to_have_count(0)
    tab.context.set_offline(False)
    tab.locator("#connection").wait_for(state="hidden")
    assert tab.inner_text("#stop-note") == "software stop, not an emergency stop"
    expect(tab, "#runs-note").to_have_text("")
    forget(tab, "ERR_INTERNET_DISCONNECTED")


def test_many_tabs_leave_a_connection_for_a_stop(open_page: Open, page_server: Served) -> None:
    """Browsers open six connections to a server; no more than four tabs may keep one."""
    first = open_page()
    others = [first.context.new_page() for _ in range(4)]
    for tab in others:
        tab.goto(page_server.server.url)
        shows(tab, "#arm-state", "active")
    shows(others[-1], "#connection", "Too many tabs")
    others[-1].keyboard.press("Escape")
    shows(others[-1], "#stop-note", "^stopped at")
    first.close()
    others[-1].locator("#connection").wait_for(state="hidden")


def test_stop_says_when_the_arm_has_no_connection(open_page: Open) -> None:
    def lose(asked: Any) -> None:
        cause = {"code": "hw.lost", "message": "gone", "node": "", "joint": "", "hint": ""}
        status = asked.fetch().json()
        asked.fulfill(json={**status, "arm": "unconfigured", "fault": cause})

    tab = open_page(prepare=lambda empty: empty.route("**/api/status", lose))
    shows(tab, "#arm-state", "^unconfigured, fault$")
    for _ in range(2):  # before a stop, and after its answer
        note = "^The arm has no connection; switch off the power of its servos.$"
        shows(tab, "#stop-note.alarm", note)
        with tab.expect_response("**/api/stop"):
            tab.click("#stop")
        expect(tab, "#stop.busy").to_have_count(0)
