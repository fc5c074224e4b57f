"""What a signed-in tab does in a browser: run tasks, answer questions, move, activate."""

from typing import Any

import pytest

from executive.api import Policy
from executive.api.move import Move
from executive.api.outcome import Outcome
from tests.executive.preview.test_dry_run import COLLIDE
from tests.support.servers.browsing import Open, expect, forget, is_accessible, shows
from tests.support.servers.serving import Serve, Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]


def task(name: str) -> str:
    return f"#tasks li:has(.name:text-is('{name}'))"


def test_a_task_runs_with_the_values_of_its_form(open_page: Open, page_server: Served) -> None:
    tab = open_page(color_scheme="dark")
    say = task("12 say")
    tab.click(f"{say} summary")
    shows(tab, say, "often how often; 1 to 3; default 1")
    tab.fill("#task-12-often", "4")
    tab.click(f"{say} button")  # the browser refuses it
    assert tab.evaluate("document.querySelector('#task-12-often').validity.rangeOverflow")
    tab.fill("#task-12-often", "2")
    tab.fill("#task-12-what", "<i>hello</i>")
    tab.click(f"{say} button")
    shows(tab, f"{say} [data-state]", "^done$")
    shows(tab, "#tree", "<i>hello</i>")
    assert page_server.executive.goals()[-1].task == 12
    is_accessible(tab)


def test_a_refused_goal_says_why(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    page_server.executive.send(10)
    shows(tab, "#goal-state", "waiting")
    tab.click(f"{task('11 nothing')} summary")
    tab.click(f"{task('11 nothing')} button")
    shows(tab, f"{task('11 nothing')} [role=alert]", "is under way")
    forget(tab, "409")


def test_a_question_is_answered(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    goal = page_server.executive.send(14).identity
    shows(tab, "#questions", "Free?")
    is_accessible(tab)
    tab.click("#questions button:text-is('yes')")
    shows(tab, "#goal-state", "^done$")
    expect(tab, "#questions section").to_have_count(0)
    assert page_server.executive.result(goal).success


def test_joints_and_tool_move_in_steps(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    tab.click("#move summary")

    def until_usable() -> None:
        expect(tab, "#move-rows button >> nth=0").to_be_enabled()

    def press(label: str) -> Outcome:
        until_usable()
        with tab.expect_response("**/api/move") as asked:
            tab.get_by_label(label).click()
        return page_server.executive.result(asked.value.json()["goal_id"])

    assert press("joint_1 more").success
    shows(tab, "#positions", r"joint_1\s*[45]\.\d°")
    until_usable()
    tab.locator("#move [aria-label='joint_2 [deg]']").focus()
    with tab.expect_response("**/api/move") as asked:
        tab.keyboard.press("PageUp")
    assert page_server.executive.result(asked.value.json()["goal_id"]).success
    before = page_server.executive.where().tool
    assert press("tool z less").success
    after = page_server.executive.where().tool
    assert before
    assert after
    assert after[2] - before[2] == pytest.approx(-0.005, abs=0.003)
    is_accessible(tab)


def test_the_arm_is_activated_from_the_page(open_page: Open, page_server: Served) -> None:
    page_server.executive.arm_to("deactivate")
    tab = open_page()
    shows(tab, "#arm-note", "The arm is inactive, so goals fail.")
    expect(tab, f"{task('0 home')} button >> nth=0").to_be_disabled()
    shows(tab, "#opening", "Activating opens the port; the arm then")
    tab.click("#activate")
    shows(tab, "#arm-state", "^active$")
    page_server.executive.arm_to("deactivate")
    page_server.executive.arm_to("cleanup")
    shows(tab, "#arm-note", "The arm is unconfigured")
    tab.click("#activate")
    shows(tab, "#arm-state", "^active$")
    assert page_server.executive.status().arm.value == "active"


def test_a_hint_names_what_the_page_has(open_page: Open, page_server: Served) -> None:
    page_server.executive.send(10)
    tab = open_page()
    tab.click(f"{task('0 home')} summary")
    tab.click(f"{task('0 home')} button:text-is('Run')")
    shows(tab, f"{task('0 home')} [role=alert]", "wait, or press STOP$")
    forget(tab, "409")


def test_a_dry_run_shows_the_motion_and_moves_nothing(open_page: Open, page_server: Served) -> None:
    (page_server.tasks / "20_collide.yaml").write_text(COLLIDE)
    tab = open_page(webgl=True)
    before = page_server.executive.goals()
    commanded = page_server.executive.where().commanded
    tab.click(f"{task('1 pick')} summary")
    tab.click(f"{task('1 pick')} button:text-is('Dry run')")
    shows(tab, f"{task('1 pick')} [role=status]", r"Dry run: \d motions?, \d\.\d s. Nothing moves")
    shows(tab, "#shown", "task 1 pick, dry run: nothing moves")
    shows(tab, "#plot-joints", r"joint_1\s*-80.2 deg")
    is_accessible(tab)
    tab.click(f"{task('20 collide')} summary")
    tab.focus(f"{task('20 collide')} button:text-is('Dry run')")
    tab.keyboard.press("Enter")
    shows(tab, "#failure", "collide would fail.*would be up to .* deep in")
    shows(tab, "#failure", "20_collide.yaml:")
    shows(tab, "#refused-note", "and the refused goal")
    assert page_server.executive.goals() == before
    assert page_server.executive.where().commanded == commanded
    page_server.executive.send(10)
    shows(tab, "#running", "^wait$")  # the live run comes back by itself
    tab.locator(f"{task('1 pick')} button:text-is('Dry run'):disabled").wait_for()


def test_poses_are_saved_recalled_and_removed(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    tab.click("#move summary")
    usable = "() => !document.querySelector('#poses button').disabled"
    tab.wait_for_function(usable)

    def go(pose: str) -> None:
        tab.wait_for_function(usable)
        with tab.expect_response("**/api/move") as asked:
            tab.click(f"#poses button:text-is('{pose}')")
        assert page_server.executive.result(asked.value.json()["goal_id"]).success

    page_server.executive.result(page_server.executive.send(Move(("joint_1=35deg",))).identity)
    tab.fill("#pose-name", "here")
    tab.keyboard.press("Enter")
    shows(tab, "#pose-saved", "here is saved in .*poses.yaml")
    go("home")
    shows(tab, "#positions", r"joint_1\s*0\.0°")
    go("here")
    shows(tab, "#positions", r"joint_1\s*3[45]\.\d°")
    tab.fill("#pose-name", "here")
    tab.keyboard.press("Enter")
    shows(tab, "#move-error", "has a pose here already")
    forget(tab, "422")
    is_accessible(tab)
    remove = "#poses [aria-label^='Remove here']"
    tab.focus(remove)
    tab.keyboard.press("Enter")
    shows(tab, remove, "^Remove\\?$")
    tab.keyboard.press("Enter")
    shows(tab, "#pose-saved", "here is removed from .*poses.yaml")
    expect(tab, "#poses button:text-is('here')").to_have_count(0)


def test_goals_wait_and_are_canceled_from_the_list(browser: Any, serve: Serve) -> None:
    served = serve(Policy.QUEUE)
    tab = browser.new_context().new_page()
    tab.goto(served.server.sign_in.link())
    shows(tab, "#policy", "others wait for its end")
    goals = [served.executive.send(10).identity for _ in range(3)]
    shows(tab, "#waiting", "task 10 wait, waiting")
    tab.click("#waiting li:nth-child(2) button")
    served.executive.result(goals[2])
    tab.wait_for_function("() => document.querySelectorAll('#waiting li').length === 1")
    tab.context.close()
