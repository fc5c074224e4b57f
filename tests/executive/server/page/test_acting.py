"""What a signed-in tab does in a browser: run tasks, answer questions, move, activate."""

from typing import Any

import pytest

from executive.api import Policy
from executive.api.move import Move
from executive.api.outcome import Outcome
from tests.executive.preview.test_dry_run import COLLIDE
from tests.executive.server.page.test_arm import BLUE, count, until_seen
from tests.support.servers.browsing import Open, Tab, expect, forget, is_accessible, shows, until
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
    tab.click("#tree .row")
    shows(tab, "#node", r"Ports\s*text\s*<i>hello</i>\s*value\s*2")  # not the defaults of the file
    assert page_server.executive.goals()[-1].task == 12
    is_accessible(tab)


TURN = """task: 21
name: turn
description: Turn.
parameters:
  far: {type: angle, default: 10 deg, min: 0, max: 95 deg, description: how far}
tree:
  subtree: move_joints
  with: {joints: {joint_1: $far}}
"""


def test_a_form_says_at_a_field_what_is_wrong(open_page: Open, page_server: Served) -> None:
    (page_server.tasks / "21_turn.yaml").write_text(TURN)
    tab = open_page()
    turn = task("21 turn")
    tab.click(f"{turn} summary")
    shows(tab, turn, "how far; 0 to 95 deg; default 10 deg")
    mistake = "document.querySelector('#task-21-far').validationMessage"
    for text, words in {
        "99 deg": "99 deg is not within the limits: 0 to 95 deg.",
        "10": "10 rad is not within the limits: 0 to 95 deg.",
        "9 inch": "There is no unit inch; there are rad, deg.",
        "far": "Write a number and a unit, such as 10 deg.",
        "95 deg": "",
        "0.5": "",
    }.items():
        tab.fill("#task-21-far", text)
        assert tab.evaluate(mistake) == words
    tab.fill("#task-21-far", "99 deg")
    tab.evaluate("document.querySelector('#task-21-far').form.noValidate = true")
    run, field = f"{turn} button:text-is('Run')", ".field:has(#task-21-far[aria-invalid])"
    tab.click(run)
    shows(tab, f"{field} [role=alert]", "^.99 deg. is more than 95 deg$")
    forget(tab, "409")
    tab.fill("#task-21-far", "95 deg")
    expect(tab, field).to_have_count(0)
    tab.click(run)  # the task allows it, and the joint does not
    shows(tab, f"{field} [role=alert]", "joint_1 = 95 deg is outside its limits")
    is_accessible(tab)


def test_who_runs_a_task_sees_it(open_page: Open, page_server: Served) -> None:
    executive = page_server.executive
    executive.result(executive.send(11).identity)
    tab = open_page()
    tab.click("#runs .run:has(.name:text-is('task 11 nothing')) >> nth=0")
    shows(tab, "#shown", "^task 11 nothing, recorded$")
    tab.click(f"{task('10 wait')} summary")
    tab.click(f"{task('10 wait')} button:text-is('Run')")
    expect(tab, "#goal-state").to_have_role("status")  # a screen reader says it
    expect(tab, "#shown").to_have_text("")
    shows(tab, "#running", "^wait$")
    shows(tab, "#runs .run", "^task 10 wait.*running")
    tab.click("#runs .run:has(.name:text-is('task 11 nothing')) >> nth=0")
    shows(tab, "#shown", "^task 11 nothing, recorded$")
    tab.click("#running .link:text-is('wait')")  # what runs is named beside any recording
    shows(tab, "#node", "^wait")
    expect(tab, "#shown").to_have_text("")


def test_a_refused_goal_says_why(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    page_server.executive.send(10)
    shows(tab, "#goal-state", "waiting")
    tab.focus("#pause")
    tab.keyboard.press("Enter")
    expect(tab, "#pause").to_be_disabled()
    expect(tab, "#pause").to_be_focused()
    tab.click(f"{task('11 nothing')} summary")
    tab.click(f"{task('11 nothing')} button")
    words = "^task 10 is under way. Wait, or press STOP$"  # which the page has, not a command
    shows(tab, f"{task('11 nothing')} [role=alert]", words)
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

    tab.focus("[aria-label='joint_1 more']")
    until_usable()
    with tab.expect_response("**/api/move") as asked:
        tab.keyboard.press("Enter")
    tab.keyboard.press("Enter")  # ignored, because the arm moves
    assert page_server.executive.result(asked.value.json()["goal_id"]).success
    expect(tab, "[aria-label='joint_1 more']").to_be_focused()
    shows(tab, "#positions", r"joint_1\s*[45]\.\d°")
    until_usable()
    tab.locator("#move [aria-label='joint_2 [deg]']").focus()
    with tab.expect_response("**/api/move") as asked:
        for _ in range(3):
            tab.keyboard.press("ArrowRight")
    assert page_server.executive.result(asked.value.json()["goal_id"]).success
    assert page_server.executive.goals()[-1].identity == asked.value.json()["goal_id"]
    shows(tab, "#positions div:nth-child(2) dd", r"^1\.[45]°$")  # not only the target of the slider
    until_usable()
    shows(tab, "#move-rows .move-row:nth-child(2) output", r"^1\.[45] deg$")
    at = tab.inner_text("#positions div:nth-child(2) dd")
    assert at == tab.inner_text("#move-rows .move-row:nth-child(2) output").replace(" deg", "°")
    for key in ("PageUp", "ArrowLeft"):  # the second while the arm moves
        with tab.expect_response("**/api/move") as asked:
            tab.keyboard.press(key)
        assert asked.value.status == 201
    assert page_server.executive.result(asked.value.json()["goal_id"]).success
    before = page_server.executive.where().tool
    assert press("tool z less").success
    after = page_server.executive.where().tool
    assert before
    assert after
    assert after[2] - before[2] == pytest.approx(-0.005, abs=0.003)
    is_accessible(tab)


def test_the_tool_turns_in_steps_if_the_arm_can_turn_it(
    open_page: Open, page_server: Served
) -> None:
    alone = open_page()
    alone.click("#move summary")
    alone.get_by_label("tool z more").wait_for()
    assert alone.get_by_label("tool pitch more").count() == 0

    def turns(asked: Any) -> None:
        answer = asked.fetch()
        asked.fulfill(response=answer, json={**answer.json(), "turns": ["roll", "pitch"]})

    tab = open_page(prepare=lambda empty: empty.route("**/api/where", turns))
    tab.click("#move summary")
    expect(tab, "[aria-label='tool pitch less']").to_be_enabled()
    assert tab.get_by_label("tool yaw more").count() == 0
    with tab.expect_request("**/api/move") as asked:
        tab.click("[aria-label='tool pitch less']")
    assert asked.value.post_data_json["to"] == ["pitch=-5deg"]
    assert asked.value.post_data_json["relative"]
    shows(tab, "#move-error", "the arm cannot turn its tool in place: it has 3 joints")
    forget(tab, "422")


def test_a_stop_carries_no_cookies_of_other_programs(open_page: Open) -> None:
    tab = open_page()
    tab.context.add_cookies([{"name": "a", "value": "b" * 3000, "url": tab.url.partition("#")[0]}])
    with tab.expect_request("**/api/stop") as asked:
        tab.click("#stop")
    assert "cookie" not in asked.value.all_headers()


SLIDER = "#move [aria-label='joint_1 [deg]']"
SET = """slider.value = 20;
for (const kind of ["input", "change"]) slider.dispatchEvent(new Event(kind));"""


@pytest.mark.parametrize("stop", ["another goal", "its own move", "an idle arm"])
def test_a_slider_moves_nothing_after_a_stop(
    open_page: Open, page_server: Served, stop: str
) -> None:
    executive = page_server.executive
    executive.result(executive.send(Move(("joint_1=0deg",))).identity)
    tab = open_page()
    tab.click("#move summary")
    more = "[aria-label='joint_2 more']"
    expect(tab, more).to_be_enabled()
    if stop == "another goal":
        executive.send(10)
        shows(tab, "#running", "^wait$")
        expect(tab, SLIDER).to_be_disabled()
    elif stop == "its own move":
        with tab.expect_response("**/api/move"):
            tab.click(more)
    before = executive.goals()
    escape = "dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' }));"
    tab.locator(SLIDER).evaluate(f"slider => {{ {SET} {escape} }}")  # within 0.4 s
    shows(tab, "#stop-note", "^stopped at")
    expect(tab, "#move-rows output >> nth=0").to_have_text("0.0 deg")
    expect(tab, more).to_be_enabled()
    assert [goal.identity for goal in executive.goals()] == [goal.identity for goal in before]


def until_it_knows_of_stops(tab: Tab, served: Served) -> None:
    """Wait until the page has a status that the server made after the last stop."""
    known = "import('/page/api.js').then((api) => api.knownStops())"
    until(tab, lambda: tab.evaluate(known) == served.executive.status().stops)


def test_a_move_that_arrives_after_a_stop_is_refused(open_page: Open, page_server: Served) -> None:
    executive, held = page_server.executive, list[Any]()

    def hold(asked: Any) -> None:
        held.append(asked)

    tab = open_page(prepare=lambda empty: empty.route("**/api/move", hold))
    tab.click("#move summary")
    more = "[aria-label='joint_1 more']"
    expect(tab, more).to_be_enabled()
    before = len(executive.goals())
    with tab.expect_request("**/api/move"):
        tab.click(more)
    tab.keyboard.press("Escape")
    shows(tab, "#stop-note", "^stopped at")
    held.pop().continue_()
    shows(
        tab,
        "#move-error",
        "^the arm was stopped after the last status that the sender had. Send it again",
    )
    forget(tab, "409")
    assert len(executive.goals()) == before
    tab.unroute("**/api/move")
    until_it_knows_of_stops(tab, page_server)
    with tab.expect_response("**/api/move") as asked:
        tab.click(more)
    assert executive.result(asked.value.json()["goal_id"]).success


def test_the_arm_is_activated_from_the_page(open_page: Open, page_server: Served) -> None:
    page_server.executive.arm_to("deactivate")
    tab = open_page()
    shows(tab, "#arm-note", "The arm is inactive, so goals fail.")
    shows(tab, "#pose-note", "^Commanded pose unknown$")
    tab.click("#move summary")
    shows(tab, "#move-rows output", "^unknown$")  # not the last one
    expect(tab, f"{task('0 home')} button >> nth=0").to_be_disabled()
    shows(tab, "#opening", "Activating opens the port; the arm then")
    tab.click("#activate")
    shows(tab, "#arm-state", "^active$")
    shows(tab, "#pose-note", "^Commanded pose$")
    page_server.executive.arm_to("deactivate")
    page_server.executive.arm_to("cleanup")
    shows(tab, "#arm-note", "The arm is unconfigured")
    tab.click("#activate")
    shows(tab, "#arm-state", "^active$")
    assert page_server.executive.status().arm.value == "active"


def test_an_activation_that_arrives_after_a_stop_is_refused(
    open_page: Open, page_server: Served
) -> None:
    executive, held = page_server.executive, list[Any]()

    def hold(asked: Any) -> None:
        held.append(asked)

    executive.arm_to("deactivate")
    executive.arm_to("cleanup")
    tab = open_page(prepare=lambda empty: empty.route("**/api/arm/configure", hold))
    with tab.expect_request("**/api/arm/configure"):
        tab.click("#activate")
    tab.keyboard.press("Escape")
    shows(tab, "#stop-note", "^stopped at")
    held.pop().continue_()
    shows(tab, "#control-error", "^the arm was stopped after the last status")
    forget(tab, "409")
    assert executive.status().arm.value == "inactive"
    until_it_knows_of_stops(tab, page_server)
    tab.click("#activate")
    shows(tab, "#arm-state", "^active$")


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
    shows(tab, "#pose-note", "^Planned pose$")
    until_seen(tab, lambda now: count(now, BLUE) > 20)  # of the arm, though the gripper moves last
    is_accessible(tab)
    tab.click(f"{task('20 collide')} summary")
    tab.focus(f"{task('20 collide')} button:text-is('Dry run')")
    tab.keyboard.press("Enter")
    shows(tab, "#failure", "collide would fail.*would be up to .* deep in")
    shows(tab, "#failure", "20_collide.yaml:")
    shows(tab, f"{task('20 collide')} [role=status]", "the task would fail.*At the goal")
    expect(tab, "#tree .at-work .name").to_have_text(["collide", "move_joints", "Target"])
    shows(tab, "#refused-note", "and the refused goal")
    assert page_server.executive.goals() == before
    assert page_server.executive.where().commanded == commanded
    page_server.executive.send(10)
    shows(tab, "#running", "^wait$")  # the live run comes back by itself
    expect(tab, f"{task('1 pick')} button:text-is('Dry run')").to_be_disabled()


def test_poses_are_saved_recalled_and_removed(open_page: Open, page_server: Served) -> None:
    tab = open_page()
    tab.click("#move summary")

    def go(pose: str) -> None:
        expect(tab, f"#poses button:text-is('{pose}')").to_be_enabled()
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


# The list of goals comes after the status.
HOLD = """() => {
  const real = fetch, held = new Promise((done) => (window.release = done));
  window.fetch = async (path, options) => {
    if (path.startsWith("api/goals?")) await held;
    return real(path, options);
  };
}"""


def test_goals_wait_and_are_canceled_from_the_list(open_page: Open, serve: Serve) -> None:
    served = serve(Policy.QUEUE)
    tab = open_page(served.server.sign_in.link())
    shows(tab, "#policy", "others wait for its end")
    shows(tab, "#tasks", "wait")  # no list is under way then
    tab.evaluate(HOLD)
    goals = [served.executive.send(10).identity for _ in range(3)]
    shows(tab, "#waiting", "(a goal|task 10 wait), waiting")
    tab.evaluate("release()")
    shows(tab, "#waiting", "task 10 wait, waiting")
    tab.click("#waiting li:nth-child(2) button")
    served.executive.result(goals[2])
    tab.wait_for_function("() => document.querySelectorAll('#waiting li').length === 1")
    tab.context.close()


def test_an_open_question_can_be_answered_after_signing_in(
    open_page: Open, page_server: Served
) -> None:
    tab = open_page(page_server.server.url)
    page_server.executive.send(14)
    shows(tab, "#questions", "Free?")
    expect(tab, "#questions button >> nth=0").to_be_hidden()
    expect(tab, "#questions p.quiet").to_have_text("Sign in to answer.")
    code = page_server.server.sign_in.link().partition("#")[2]
    tab.evaluate("code => { location.hash = code }", code)
    shows(tab, "#session", "^signed in$")
    expect(tab, "#questions p.quiet").to_be_hidden()
    tab.click("#questions button:text-is('yes')")
    shows(tab, "#goal-state", "^done$")


def test_a_form_keeps_what_was_typed_when_another_task_changes(
    open_page: Open, page_server: Served
) -> None:
    other = page_server.tasks / "22_other.yaml"
    other.write_text("task: 22\nname: other\ndescription: Old.\ntree:\n  Succeed: {}\n")
    tab = open_page()
    tab.click(f"{task('12 say')} summary")
    tab.fill("#task-12-what", "half a sen")
    other.write_text("task: 22\nname: other\ndescription: New.\ntree:\n  Succeed: {}\n")
    page_server.executive.send(11)
    expect(tab, f"{task('22 other')} p.quiet >> nth=0").to_have_text("New.")
    expect(tab, "#task-12-what").to_have_value("half a sen")
    expect(tab, "#task-12-what").to_be_focused()
    tab.keyboard.type("tence")
    expect(tab, "#task-12-what").to_have_value("half a sentence")


def test_what_asks_or_answers_is_brought_into_view(open_page: Open, page_server: Served) -> None:
    tab = open_page(viewport={"width": 1280, "height": 600})
    for name in ("13 fail", "12 say"):
        tab.click(f"{task(name)} summary")
    tab.click(f"{task('12 say')} button:text-is('Dry run')")
    shows(tab, f"{task('12 say')} [role=status]", "^Dry run")
    expect(tab, f"{task('12 say')} [role=status]").to_be_in_viewport(ratio=1)
    tab.click("#live")
    page_server.executive.send(14)
    shows(tab, "#questions", "Free?")
    expect(tab, "#questions section").to_be_in_viewport(ratio=1)
    tab.click("#questions button:text-is('yes')")
    shows(tab, "#goal-state", "^done$")
    tab.click(f"{task('13 fail')} button:text-is('Run')")
    shows(tab, "#failure", "fail failed")
    expect(tab, "#failure .cause").to_be_in_viewport(ratio=1)


def test_long_names_of_joints_are_not_cut(open_page: Open) -> None:
    def rename(asked: Any) -> None:
        answer = asked.fetch().json()
        units = {f"shoulder_{name}": unit for name, unit in answer["units"].items()}
        limits = {f"shoulder_{name}": pair for name, pair in answer["limits"].items()}
        asked.fulfill(json={**answer, "units": units, "limits": limits})

    tab = open_page(prepare=lambda empty: empty.route("**/api/where", rename))
    tab.click("#move summary")
    tab.get_by_label("shoulder_joint_1 more").wait_for()
    cut = "each => each.scrollWidth > each.clientWidth"
    assert not tab.locator(".move-row span").first.evaluate(cut)


def test_a_step_that_fails_says_why_beside_it(open_page: Open, page_server: Served) -> None:
    executive = page_server.executive
    executive.result(executive.send(Move(("joint_1=90deg",))).identity)
    tab = open_page()
    tab.click("#move summary")
    more = "[aria-label='joint_1 more']"
    expect(tab, more).to_be_enabled()
    tab.evaluate("window.scrollTo(0, 300)")
    tab.locator(more).evaluate("each => each.click()")
    shows(tab, "#move-error", "joint_1 = 95 deg is outside its limits")
    shows(tab, "#failure", "joint_1 = 95 deg is outside its limits")
    assert tab.evaluate("scrollY") > 250  # the next click finds the same button
