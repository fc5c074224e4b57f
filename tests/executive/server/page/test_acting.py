"""What a signed-in tab does in a browser: run tasks, answer questions, move, activate."""

import pytest

from executive.api.outcome import Outcome
from tests.support.servers.browsing import Open, forget, is_accessible, shows
from tests.support.servers.serving import Served

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
    assert tab.locator("#questions section").count() == 0
    assert page_server.executive.result(goal).success


def test_joints_and_tool_move_in_steps(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    tab.click("#move summary")

    def until_usable() -> None:
        tab.wait_for_function("() => !document.querySelector('#move-rows button').disabled")

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
    assert tab.is_disabled(f"{task('0 home')} button")
    shows(tab, "#opening", "Activating opens the port; the arm then")
    tab.click("#activate")
    shows(tab, "#arm-state", "^active$")
    assert page_server.executive.status().arm.value == "active"
