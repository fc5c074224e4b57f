"""The tree of a run in a browser: live and recorded, with its failure, and how it is held."""

from itertools import product
from typing import Any

import pytest

from tests.support.recordings.finished import at_rest
from tests.support.servers.browsing import (
    Open,
    Tab,
    expect,
    forget,
    is_accessible,
    shows,
    until,
)
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

DELIVER = """task: 20
name: deliver
description: Fail deep inside.
tree:
  sequence:
    - Say: {text: hello}
    - retry:
        sequence:
          - subtree: show
            with: {what: "<b>bold</b>"}
          - Fail: {reason: "<img src=x onerror=alert(1)> is not there"}
      attempts: 2
"""
SHOW = """subtree: show
description: Say something.
ports: {what: {type: text, description: what}}
tree:
  Say: {text: $what}
"""
WAIT, LARGE = 10, 21
STEPS = 24


def write_tasks(served: Served) -> None:
    part = "".join(f"        - Say: {{text: line {k}}}\n" for k in range(STEPS))
    parts = f"    - sequence:\n{part}" * 40
    large = f"task: {LARGE}\nname: large\ndescription: Many nodes.\ntree:\n  sequence:\n{parts}"
    (served.tasks / "21_large.yaml").write_text(f"{large}    - Wait: {{duration: 1 h}}\n")
    (served.tasks / "20_deliver.yaml").write_text(DELIVER)
    (served.tasks / "show.yaml").write_text(SHOW)


def ended(served: Served, task: int) -> None:
    served.executive.result(served.executive.send(task).identity)


def row(name: str) -> str:
    return f".row:has(> .name:text-is('{name}'))"


def focused(tab: Tab) -> str:
    return str(tab.evaluate("document.activeElement.dataset.path"))


def test_why_an_earlier_run_failed(open_page: Open, page_server: Served) -> None:
    write_tasks(page_server)
    ended(page_server, 20)
    tab = open_page(color_scheme="dark")
    shows(tab, "#shown", "^task 20 deliver, recorded$")
    shows(tab, "#failure", "deliver failed.*<img src=x onerror=alert.1.> is not there")
    shows(tab, "#failure", "20_deliver.yaml:11")
    expect(tab, row("Fail")).to_have_attribute("data-status", "FAILURE")
    expect(tab, "#tree .at-work").to_have_count(4)  # the path to the failure
    tab.click("#failure .link")
    expect(tab, row("Fail")).to_have_attribute("aria-selected", "true")
    tab.emulate_media(color_scheme="dark", forced_colors="active")  # leaves no shadow
    for marked in (row("Fail"), "#runs [aria-current]"):
        expect(tab, marked).to_have_css("border-left-style", "solid")
    tab.emulate_media(color_scheme="dark", forced_colors="none")
    shows(tab, "#node", "deliver/retry/sequence/Fail")
    tab.keyboard.press("ArrowUp")
    assert focused(tab) == "deliver/retry/sequence/show"
    shows(tab, "#node", "show.yaml:5, used by 20_deliver.yaml:9.*text.*<b>bold</b>")
    for key in ("ArrowLeft", "ArrowLeft"):  # to the sequence, which it then folds
        tab.keyboard.press(key)
    expect(tab, row("Fail")).to_have_count(0)
    expect(tab, row("sequence")).to_have_attribute("aria-expanded", "false")
    tab.fill("#search", "is not there")
    expect(tab, "#tree .name").to_have_text(["deliver", "retry", "sequence", "Fail"])
    is_accessible(tab)


FAR = """task: 22
name: far
description: Too far.
tree:
  sequence:
    - Say: {text: hello}
    - subtree: move_joints
      with: {joints: {joint_1: 200 deg}}
"""


def test_a_task_that_was_refused_before_its_run_has_its_tree(
    open_page: Open, page_server: Served
) -> None:
    (page_server.tasks / "22_far.yaml").write_text(FAR)
    tab = open_page()
    tab.locator("#tasks li").first.wait_for()
    ended(page_server, 22)
    for when in ("live", "recorded"):
        shows(tab, "#failure", "joint_1 = 200 deg is outside its limits")
        tab.click("#failure .link")
        shows(tab, "#node", "far/move_joints/Target")
        expect(tab, row("Target")).to_have_attribute("data-status", "FAILURE")
        expect(tab, "#tree .at-work .name").to_have_text(["far", "move_joints", "Target"])
        if when == "live":
            at_rest(page_server.folder / "recordings")
            tab.reload()
            shows(tab, "#shown", "far, recorded")
    tab.focus("#moment")
    for key, status in (("Home", "INVALID"), ("End", "FAILURE")):
        tab.keyboard.press(key)
        expect(tab, row("Target")).to_have_attribute("data-status", status)


PHONE = {"width": 390, "height": 844}


def test_why_an_earlier_run_failed_is_found_on_a_phone_and_by_keyboard(
    open_page: Open, page_server: Served
) -> None:
    write_tasks(page_server)
    for number in (20, 11):
        ended(page_server, number)
    tab = open_page(viewport=PHONE)
    shows(tab, "#shown", "^task 11 nothing, recorded$")
    to = "document.activeElement.dataset.to ?? document.activeElement.id"
    found = []
    for _ in range(4):
        tab.keyboard.press("Tab")
        found.append(tab.evaluate(to))
    assert found == ["stop", "tree-panel", "tasks-panel", "runs-panel"]
    is_accessible(tab)
    tab.keyboard.press("Enter")
    assert tab.evaluate(to) == "runs-panel"
    expect(tab, "#runs-panel").to_have_accessible_name("Recordings")
    expect(tab, "#skip").to_have_css("width", "1px")
    run = "#runs .run:has(.name:text-is('task 20 deliver'))"
    while not tab.evaluate(f"document.activeElement.matches(`{run.split(':has')[0]}`)"):
        tab.keyboard.press("Tab")
    tab.keyboard.press("Tab")  # from the newest to the one before
    tab.keyboard.press("Enter")
    shows(tab, "#failure", "deliver failed")
    expect(tab, "#failure .cause").to_be_in_viewport(ratio=1)
    tab.focus("#tree [tabindex='0']")
    expect(tab, row("Fail")).to_be_in_viewport()  # though the tree is longer than what is seen
    tab.focus("[data-to='failure']")
    tab.keyboard.press("Enter")
    tab.keyboard.press("Tab")
    tab.keyboard.press("Enter")
    assert focused(tab) == "deliver/retry/sequence/Fail"


def test_a_breakpoint_holds_the_goal_until_a_step(open_page: Open, page_server: Served) -> None:
    write_tasks(page_server)
    ended(page_server, 20)
    tab = open_page()
    tab.locator(row("show")).wait_for()
    tab.click(f"{row('show')} .point")
    shows(tab, f"{row('show')} .point", "●")
    marked = tab.get_by_role("treeitem", name="breakpoint").all()
    assert [each.get_attribute("data-path").split("/")[-1] for each in marked] == ["show"]
    page_server.executive.send(20)
    shows(tab, "#paused", "^Paused at .*Step or resume")
    is_accessible(tab)
    assert page_server.executive.status().paused
    tab.click("#step")
    shows(tab, "#paused", "^Paused at Fail")
    tab.click("#resume")
    shows(tab, "#goal-state", "attempt 2")  # before, the pause of the first may still be shown
    shows(tab, "#paused", "^Paused at")
    tab.focus(row("show"))
    tab.keyboard.press("b")
    tab.click("#resume")
    shows(tab, "#goal-state", "^failed$")
    assert page_server.executive.status().breakpoints == ()
    expect(tab, "#pause").to_be_disabled()


def test_a_goal_that_begins_while_an_earlier_run_loads_is_shown(
    open_page: Open, page_server: Served
) -> None:
    write_tasks(page_server)
    ended(page_server, 20)
    held: list[Any] = []

    def hold(asked: Any) -> None:
        held.append(asked)

    tab = open_page(prepare=lambda empty: empty.route("**/api/recordings/*/series", hold))
    until(tab, lambda: held)
    page_server.executive.send(WAIT)
    shows(tab, "#running", "^wait$")
    held[0].continue_()
    for _ in range(2):  # the second period begins when the page has read the events
        with tab.expect_response("**/api/status"):
            pass
    assert tab.inner_text("#running") == "wait"
    assert tab.inner_text("#shown") == ""


def test_a_tab_that_is_not_signed_in_changes_nothing(open_page: Open, page_server: Served) -> None:
    tab, before = open_page(page_server.server.url), page_server.executive.status().breakpoints
    page_server.executive.send(WAIT)
    shows(tab, "#running", "^wait$")
    tab.context.set_offline(True)
    shows(tab, "#connection", "No connection")
    tab.context.set_offline(False)  # the new stream repeats the current state
    tab.locator("#connection").wait_for(state="hidden")
    shows(tab, "#running", "^wait$")
    forget(tab, "ERR_INTERNET_DISCONNECTED")
    assert "\u00d7" not in tab.inner_text("#tree")
    expect(tab, "#pause").to_be_disabled()
    tab.click(".row .point")
    shows(tab, "#control-error", "needs the server's token")
    forget(tab, "401")
    assert page_server.executive.status().breakpoints == before


def test_a_thousand_nodes_are_folded_around_what_runs(open_page: Open, page_server: Served) -> None:
    write_tasks(page_server)
    tab = open_page()
    page_server.executive.send(LARGE)
    shows(tab, "#running", "^Wait$")
    expect(tab, "#tree .row").to_have_count(42)
    expect(tab, row("Wait")).to_have_attribute("data-status", "RUNNING")
    tab.wait_for_function("() => document.getElementById('tree').scrollTop > 0")  # it follows
    tab.click(".row:nth-child(2) .fold")
    expect(tab, "#tree .row").to_have_count(42 + STEPS)
    height = "document.querySelector('.row').getBoundingClientRect().height"
    before = tab.evaluate(height)
    tab.click("#tree-smaller")
    assert tab.evaluate(height) == pytest.approx(before / 1.2, abs=0.5)
    tab.click("#tree-larger")
    tab.fill("#search", "line 7")
    expect(tab, "#tree .row").to_have_count(1 + 40 + 40)
    is_accessible(tab)
    tab.keyboard.press("Escape")
    shows(tab, "#goal-state", "^canceled$")
    shows(tab, "#runs [aria-current]", "large")


def test_the_tree_keeps_the_focus_as_rows_come_and_go(open_page: Open, page_server: Served) -> None:
    write_tasks(page_server)
    tab = open_page()
    goals = page_server.executive
    goals.send(LARGE)
    shows(tab, "#running", "^Wait$")
    tab.focus("#tree .row")
    tab.keyboard.press("ArrowDown")
    path = focused(tab)
    for key, state in (("ArrowRight", "true"), ("ArrowLeft", "false")):
        tab.keyboard.press(key)
        expect(tab, f"#tree [data-path='{path}']").to_have_attribute("aria-expanded", state)
        assert focused(tab) == path
    tab.keyboard.press("ArrowRight")
    tab.keyboard.press("ArrowRight")  # into it
    assert focused(tab).startswith(f"{path}/")
    tab.click(f"#tree [data-path='{path}'] .fold")
    assert focused(tab) == path  # nearest to the row that is folded away
    tab.evaluate("document.querySelector('#tree .row').focus()")
    goals.cancel()
    shows(tab, "#goal-state", "^canceled$")
    goals.send(LARGE)  # its rows are others
    shows(tab, "#running", "^Wait$")
    tab.wait_for_function("() => document.activeElement.dataset.path === 'large'")


def test_the_details_of_a_node_are_seen_when_it_is_clicked(
    open_page: Open, page_server: Served
) -> None:
    write_tasks(page_server)
    ended(page_server, 20)
    tab = open_page()
    shows(tab, "#shown", "recorded")
    sizes = ((1280, 800), (1000, 700), (390, 844))
    for (width, height), by_key in product(sizes, (False, True)):
        tab.set_viewport_size({"width": width, "height": height})
        tab.evaluate("scrollTo(0, 0)")
        if by_key:
            tab.focus(row("show"))
            tab.keyboard.press("Enter")
        else:
            tab.click(row("show"))
        shows(tab, "#node", "show.yaml")
        tab.wait_for_function(
            """() => {
              const [node, player] = ['node', 'player'].map((id) =>
                document.getElementById(id).getBoundingClientRect());
              return node.top >= 0 && node.bottom <= player.top;
            }"""
        )
