"""What disturbs a page: other pages, a slow machine, a hidden tab, and a server that restarts."""

from typing import Any

import pytest

from tests.support.servers.browsing import Open, shows
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


def test_a_slow_and_a_hidden_tab_catch_up_and_stop(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    shows(tab, "#arm-state", "^active$")
    tab.evaluate(HIDE, True)
    while b"armtree_watchers 0.0" not in page_server.ask("GET", "/metrics")[1]:
        tab.wait_for_timeout(20)  # until it closes its stream
    goal = page_server.executive.send(10).identity
    tab.evaluate(HIDE, False)
    shows(tab, "#running", "^wait$")
    tab.context.new_cdp_session(tab).send("Emulation.setCPUThrottlingRate", {"rate": 6})
    page_server.executive.cancel()
    page_server.executive.result(goal)
    page_server.executive.send(10)
    shows(tab, "#running", "^wait$")
    tab.keyboard.press("Escape")
    shows(tab, "#stop-note", "^stopped at")
    shows(tab, "#goal-state", "^canceled$")


def test_a_server_that_restarts_is_found_again(browser: Any, serve: Serve) -> None:
    served = serve()
    port = served.server.port
    tab = browser.new_context().new_page()
    tab.goto(served.server.sign_in.link())
    shows(tab, "#session", "^signed in$")
    served.executive.send(10)
    shows(tab, "#running", "^wait$")
    served.stop()
    shows(tab, "#connection", r"No connection for \d+ s")
    again = serve(port=port)
    tab.locator("#connection").wait_for(state="hidden")
    shows(tab, "#session", "^watching only$")
    again.executive.send(10)
    shows(tab, "#running", "^wait$")
    tab.keyboard.press("Escape")
    shows(tab, "#goal-state", "^canceled$")
    tab.goto(again.server.sign_in.link())
    shows(tab, "#session", "^signed in$")
    tab.context.close()
    again.stop()
