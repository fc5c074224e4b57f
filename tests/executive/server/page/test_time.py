"""A run over time in a browser: plots, phases and log, all at one cursor."""

import logging
from collections.abc import Callable
from typing import Any

import pytest

import logs
from executive.api.move import Move
from executive.cli.support.log_handler import recorded_log
from tests.support.recordings.finished import at_rest
from tests.support.servers.browsing import Open, Tab, expect, is_accessible, shows
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]


def lines(tab: Tab) -> list[str]:
    return list(tab.locator("#log li").all_inner_texts())


def test_a_run_is_plotted_at_one_time(open_page: Open, page_server: Served) -> None:
    tab = open_page(color_scheme="dark")
    tab.locator("#plots canvas").first.wait_for()
    move = Move(("joint_1=60deg", "joint_2=20deg"), speed=0.5)
    page_server.executive.result(page_server.executive.send(move).identity)
    shows(tab, "#goal-state", "^done$")
    shows(tab, "#plot-joints", r"joint_1\s*6\d\.\d deg")
    shows(tab, "#phases", "executing")
    assert tab.locator("#plots figure").count() == 3
    is_accessible(tab)
    # A click into a plot moves the cursor, and the values with it.
    over = tab.locator("#plots .u-over").first
    over.click(position={"x": 2, "y": 20})
    shows(tab, "#plot-time", r"^0\.\d\d s")
    shows(tab, "#plot-joints", r"joint_1\s*(0\.0 deg)?joint_2")
    shows(tab, "#shown", "an earlier moment")
    shows(tab, "#positions", r"joint_1\s*(unknown|0\.\d°)")  # 3D and tree are at that time, too
    assert tab.locator("#tree [data-status=SUCCESS]").count() < tab.locator("#tree .row").count()
    with_all = over.evaluate("each => each.parentElement.querySelector('canvas').toDataURL()")
    tab.focus("#plot-joints input")
    tab.keyboard.press("Space")
    without = tab.locator("#plots canvas").first.evaluate("each => each.toDataURL()")
    assert without != with_all
    tab.keyboard.press("Space")
    tab.click("#zoom-in")
    assert tab.locator("#plots canvas").first.evaluate("each => each.toDataURL()") != with_all


def test_the_log_is_filtered_in_and_out(open_page: Open, page_server: Served) -> None:
    executive = page_server.executive
    tab = open_page()
    goal = executive.send(10).identity
    shows(tab, "#running", "^wait$")
    shows(tab, "#tree .time", r"^[1-9]\d*\.\d s$")  # it grows while nothing else happens
    for level, word in ((20, "one"), (20, "two"), (40, "three")):
        now = page_server.clock.now()
        executive.record(logs.LogLine(now, level, "armtree", f"{word} word"))
    shows(tab, "#log", "three word")
    tab.fill("#log-search", "word -two")
    assert len(lines(tab)) == 2
    tab.select_option("#log-level", "40")
    assert [line.split("\n")[-1] for line in lines(tab)] == ["error: three word"]
    tab.select_option("#log-level", "0")
    tab.fill("#log-search", "")
    tab.focus("#log")
    for key in (*["ArrowUp"] * 5, "Enter"):  # to the first line
        tab.keyboard.press(key)
    tab.wait_for_timeout(300)  # until it is drawn
    shows(tab, "#shown", "task 10 wait, an earlier moment")  # tree and 3D are at that time, too
    expect(tab, "#pause").to_be_enabled()  # the run goes on
    before = tab.inner_text("#plot-time")
    tab.wait_for_timeout(1100)  # the cursor does not follow the run any more
    assert tab.inner_text("#plot-time") == before
    is_accessible(tab)
    tab.click("#live")
    expect(tab, "#shown").to_have_text("")
    shows(tab, "#running", "^wait$")
    executive.cancel(goal)


def test_the_log_has_the_words_of_the_page(
    open_page: Open, page_server: Served, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    tab = open_page()
    tab.click("#tasks li:has(.name:text-is('10 wait')) summary")
    with recorded_log(page_server.executive):
        tab.click("#tasks li:has(.name:text-is('10 wait')) button:text-is('Run')")
        shows(tab, "#log", "Executing the goal for task 10 from a browser")
        tab.keyboard.press("Escape")
        shows(tab, "#goal-state", "^canceled$")
    assert not [line for line in lines(tab) if "Mozilla" in line or "POST" in line]


def test_a_recorded_run_is_plotted_too(open_page: Open, page_server: Served) -> None:
    executive = page_server.executive
    for target in ("joint_1=-60deg", "joint_1=-20deg"):
        executive.result(executive.send(Move((target,), False, 1.0)).identity)
    at_rest(folder := page_server.folder / "recordings")
    max(folder.glob("*Z-move.mcap")).unlink()
    tab = open_page()
    shows(tab, "#shown", "joint_1=-60deg, recorded")
    shows(tab, "#positions", r"joint_1\s*-20\.0°")  # where the arm is now
    shows(tab, "#plot-joints", r"joint_1\s*-60\.0 deg")  # though its last frame is a bit before

    def rename(asked: Any) -> None:
        asked.fulfill(json={**asked.fetch().json(), "name": "another"})

    other = open_page(prepare=lambda empty: empty.route("**/api/recordings/*/robot", rename))
    shows(other, "#positions", r"joint_1\s*-60\.0°")  # another robot has no pose of this one
    tab.click("#runs .run >> nth=0")
    shows(tab, "#positions", r"joint_1\s*-60\.0°")
    shows(tab, "#phases", "executing")
    late = "#plots figure:nth-child(3) canvas"
    assert tab.locator(late).evaluate(
        "each => new Set(each.getContext('2d').getImageData(60, 10, 300, 80).data).size > 2"
    )


def test_position_limits_are_plotted(open_page: Open, page_server: Served) -> None:
    def unlimited(asked: Any) -> None:
        robot = asked.fetch().json()
        for joint in robot["joints"]:
            joint["limits"] = []
        asked.fulfill(json=robot)

    def plotted(prepare: Callable[[Tab], object]) -> str:
        tab = open_page(prepare=prepare)
        shows(tab, "#shown", "recorded")
        shows(tab, "#plot-joints", r"joint_1\s*90\.0 deg")
        beyond.append(tab.locator("#plots .beyond").first.inner_text())
        canvas = tab.locator("#plots canvas").first
        return str(canvas.evaluate("each => each.toDataURL()"))

    executive, beyond = page_server.executive, list[str]()
    executive.result(executive.send(Move(("joint_1=90deg",))).identity)
    assert plotted(id) != plotted(lambda empty: empty.route("**/robot", unlimited))
    assert beyond == ["next limit -90", ""]
