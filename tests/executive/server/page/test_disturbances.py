"""What disturbs a page: other pages, a slow machine, a hidden tab, and a server that restarts."""

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.support.command_line.pseudo_terminal import ARMTREE
from tests.support.recordings.finished import at_rest
from tests.support.servers.browsing import Open, Tab, expect, forget, shows, until
from tests.support.servers.serving import Serve, Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", {value: hidden, configurable: true});
  document.dispatchEvent(new Event("visibilitychange"));
}"""


# The browser answers a request for a lock later. The tab is hidden meanwhile, once.
HIDE_AT_FIRST_LOCK = f"""(() => {{
  const request = navigator.locks.request.bind(navigator.locks);
  navigator.locks.request = (name, options, act) => {{
    navigator.locks.request = request;
    return request(name, options, (lock) => {{ ({HIDE})(true); return act(lock); }});
  }};
}})()"""


def test_two_pages_show_and_do_the_same(open_page: Open, page_server: Served) -> None:
    one, two = open_page(), open_page(viewport={"width": 390, "height": 844})
    ask = "#tasks li:has(.name:text-is('14 ask'))"
    one.click(f"{ask} summary")
    one.click(f"{ask} button:text-is('Run')")
    for tab in (one, two):
        shows(tab, "#questions", "Free?")
        shows(tab, "#running", "^ask")
    two.click("#questions button:text-is('yes')")
    for tab in (one, two):
        shows(tab, "#goal-state", "^done$")
        assert tab.locator("#questions section").count() == 0
    page_server.executive.send(10)
    shows(one, "#running", "^wait$")
    two.click("#stop")
    shows(two, "#stop-note", "^stopped at")
    shows(one, "#goal-state", "^canceled$")


def tell_unfinished(asked: Any) -> None:
    """Answer as the server does before the recording of a goal that has ended is complete."""
    answer = asked.fetch().json()
    for each in answer["recordings"]:
        each |= {"state": "UNFINISHED", "code": "log.in_use"}
    asked.fulfill(json=answer)


def test_a_slow_and_a_hidden_tab_catch_up_and_stop(open_page: Open, page_server: Served) -> None:
    def closed() -> bool:
        """Whether no tab has a stream."""
        return b"armtree_watchers 0.0" in page_server.ask("GET", "/metrics")[1]

    tab = open_page()
    shows(tab, "#arm-state", "^active$")
    tab.evaluate(HIDE, True)
    until(tab, closed)
    goal = page_server.executive.send(10).identity
    tab.evaluate(HIDE, False)
    shows(tab, "#running", "^wait$")
    tab.evaluate(HIDE, True)  # it does not see how the goal ends
    until(tab, closed)
    page_server.executive.cancel()
    page_server.executive.result(goal)
    at_rest(page_server.folder / "recordings")
    tab.route("**/api/recordings?*", tell_unfinished, times=1)
    tab.evaluate(HIDE, False)
    shows(tab, "#goal-state", "^canceled$")
    shows(tab, "#shown", "^task 10 wait, recorded$")
    goal = page_server.executive.send(10).identity
    shows(tab, "#running", "^wait$")
    tab.context.new_cdp_session(tab).send("Emulation.setCPUThrottlingRate", {"rate": 6})
    page_server.executive.cancel()
    page_server.executive.result(goal)
    tab.route("**/api/recordings?*", tell_unfinished)
    page_server.executive.send(10)
    shows(tab, "#running", "^wait$")
    tab.keyboard.press("Escape")
    shows(tab, "#stop-note", "^stopped at")
    shows(tab, "#goal-state", "^canceled$")
    expect(tab, "#runs [data-state] >> nth=0").to_have_text("canceled")


def test_a_tab_that_is_hidden_before_its_stream_begins_has_none(
    open_page: Open, page_server: Served
) -> None:
    asked = list[str]()

    def prepare(tab: Tab) -> None:
        tab.add_init_script(HIDE_AT_FIRST_LOCK)
        tab.on("request", lambda request: asked.append(request.url))

    tab = open_page(prepare=prepare)
    assert any(tab.evaluate("document.hidden") or tab.wait_for_timeout(20) for _ in range(1000))
    tab.evaluate(HIDE, True)  # what it asked for before is known then
    assert not any(url.endswith("/api/events") for url in asked)
    tab.evaluate(HIDE, False)
    page_server.executive.send(10)
    shows(tab, "#running", "^wait$")


def test_what_failed_to_load_is_loaded_later(open_page: Open, page_server: Served) -> None:
    page_server.executive.result(page_server.executive.send(11).identity)

    def prepare(tab: Tab) -> None:
        tab.route("**/libraries.js*", lambda asked: asked.abort())

    tab = open_page(prepare=prepare, webgl=True)
    shows(tab, "#no-3d", "The page could not load 3D and plots. It tries again")
    shows(tab, "#shown", "^task 11 nothing, recorded$")
    shows(tab, "#positions", "joint_1")
    tab.unroute("**/libraries.js*")
    tab.evaluate(HIDE, True)
    tab.evaluate(HIDE, False)
    tab.locator("#arm canvas").wait_for()
    expect(tab, "#no-3d").to_have_text("")
    tab.locator("#plots canvas").first.wait_for()
    forget(tab, "ERR_FAILED")


def test_a_server_that_is_killed_and_restarts_is_found_again(
    browser: Any, serve: Serve, tmp_path: Path
) -> None:
    words = ("serve", "--port", "virtual", "--tcp-port", "0", "--activate")
    served = serve(active=False)  # gives the folder its tasks
    served.stop()
    folders = ("--trees", str(served.tasks), "--recordings", str(tmp_path / "recordings"))
    with subprocess.Popen(
        [*ARMTREE, *words, *folders], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr
        log = ""
        while "ready to take commands" not in log:
            log += process.stderr.readline()
        (link,) = re.findall(r"http://\S+#code=\S+", log)
        port = int(re.findall(r":(\d+)/", link)[0])
        tab = browser.new_context().new_page()
        tab.goto(link)
        shows(tab, "#session", "^signed in$")
        tab.click("#tasks li:has(.name:text-is('10 wait')) summary")
        tab.click("#tasks li:has(.name:text-is('10 wait')) button")
        shows(tab, "#running", "^wait$")
        process.kill()
    shows(tab, "#connection", r"No connection for \d+ s")
    shows(tab, "#running", "^wait$")  # what was known, greyed
    again = serve(port=port)
    tab.locator("#connection").wait_for(state="hidden")
    shows(tab, "#session", "^watching only$")
    shows(tab, "#goal-state", "^failed$")  # and is not shown as running for ever
    shows(tab, "#failure", "the server or command that ran this goal ended before the goal")
    shows(tab, "#running", "^nothing$")
    tab.select_option("#runs-state", "UNFINISHED")
    shows(tab, "#runs li", "^task 10 wait.*cut off")
    tab.click("#runs li button")
    shows(tab, "#failure", "the server or command that ran this goal ended before the goal")
    assert tab.inner_text("#failure").count("check the position") == 1
    shows(tab, "#running", "^nothing$")
    tab.evaluate("scrollTo(0, 0)")
    tab.click("#live")
    again.executive.send(10)
    shows(tab, "#running", "^wait$")
    tab.keyboard.press("Escape")
    shows(tab, "#goal-state", "^canceled$")
    tab.goto(again.server.sign_in.link())
    shows(tab, "#session", "^signed in$")
    again.stop()
    shows(tab, "#connection", r"No connection for \d+ s")
    tab.context.close()


# Waits at most 0.2 s for anything.
HURRY = """const { timeout } = AbortSignal, wait = setTimeout;
AbortSignal.timeout = (longest) => timeout.call(AbortSignal, Math.min(longest, 200));
window.setTimeout = (act, after) => wait(act, Math.min(after ?? 0, 200));"""
HANG = {"health", "status", "events", "robot", "goals", "tasks", "recordings", "where", "nodes"}


def test_a_request_that_hangs_keeps_no_other_back(open_page: Open, page_server: Served) -> None:
    executive, held = page_server.executive, dict[str, Any]()
    executive.result(executive.send(13).identity)

    def hold(asked: Any) -> None:
        """Answer the first request of each kind never."""
        kind = asked.request.url.partition("?")[0].rpartition("/")[2]
        if kind in held or kind not in HANG:
            asked.continue_()
        held.setdefault(kind, asked)

    def prepare(empty: Tab) -> None:
        empty.add_init_script(HURRY)
        empty.route("**/api/**", hold)

    tab = open_page(page_server.server.url, prepare)
    tab.locator("#tasks li").first.wait_for()
    shows(tab, "#runs li", "13 fail")
    shows(tab, "#robot", "^arduinobot$")
    shows(tab, "#failure", "13_fail.yaml:5")
    assert held.keys() >= HANG


def test_requests_without_an_answer_are_made_again_with_the_next_stream(
    open_page: Open, page_server: Served
) -> None:
    paths = [f"**/api/{each}" for each in ("goals?*", "where", "poses")]
    lost = set[str]()

    def lose(asked: Any) -> None:
        lost.add(asked.request.url)
        asked.abort()

    def prepare(empty: Tab) -> None:
        for path in paths:
            empty.route(path, lose)

    tab = open_page(prepare=prepare)
    until(tab, lambda: len(lost) >= len(paths))
    tab.unroute_all()
    tab.context.set_offline(True)
    shows(tab, "#connection", "No connection")
    tab.context.set_offline(False)
    tab.locator("#tasks li").first.wait_for()
    tab.click("#move summary")
    tab.get_by_label("joint_1 more").wait_for()
    tab.locator("#poses li").first.wait_for()
    for words in ("ERR_FAILED", "ERR_INTERNET_DISCONNECTED"):
        forget(tab, words)
