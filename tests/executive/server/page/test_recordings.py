"""Recordings in a browser: found, played, compared, and what is done with them."""

import re
from pathlib import Path
from typing import Any

import pytest

from executive.api.move import Move
from executive.server.server import Viewer
from tests.support.recordings.bombs import BOMBS
from tests.support.recordings.finished import at_rest
from tests.support.recordings.long_recording import write_long
from tests.support.servers.browsing import Open, Tab, expect, forget, is_accessible, shows
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

LONG = "20261101T000000.000Z-2.mcap"
MESSAGES = 10_000

# Plays all events of a recording, and compares the state at some moments with what windows give. If
# frames are late, each follows the event after it, as after a slow write.
SAME_STATES = """async ([name, count, late]) => {
  const { RecordedRun } = await import("./page/model/recorded_run.js");
  const { Run } = await import("./page/model/run.js");
  const path = `api/recordings/${name}`;
  const about = await (await fetch(path)).json();
  const windows = [];
  for (let at = 0; at < about.duration_s; at = windows.at(-1).to_s)
    windows.push(await (await fetch(`${path}/events?at=${at}`)).json());
  const events = windows.flatMap((window) => window.events);
  events.sort((one, other) => one.time_s - other.time_s);
  const state = (run) => JSON.stringify([
    run.goalId, run.title, run.state, run.percentage, run.phase, run.attempt, run.positions,
    run.schedule?.time_s, run.world, run.refused, run.outcome,
    [...run.nodes.values()].filter((n) => n.starts)
      .map((n) => ({ ...n, parent: n.parent?.path, children: n.children.length })),
  ]);
  const played = (time) => {
    const run = new Run();
    for (const event of events) if (event.time_s - about.began_s <= time + 1e-6) run.update(event);
    return state(run);
  };
  const { fetch: ask } = window;
  window.fetch = async (asked, ...rest) => {
    const answer = await ask(asked, ...rest);
    if (!late || !asked.includes("/events")) return answer;
    const window = await answer.json(), { events: all } = window;
    for (let at = 0; at + 1 < all.length; at++)
      if (all[at].event === "sent") all.splice(at, 2, all[at + 1], all[at++]);
    return new Response(JSON.stringify(window));
  };
  const recorded = new RecordedRun(name);
  await recorded.open();
  const wrong = [];
  let random = 1, time = 0;
  const next = () => (random = (random * 48271) % 2147483647) / 2147483647;
  for (let number = 0; number < count; number++) {
    // jumps, small steps back and on, and the exact moments of events and of cuts
    const moments = [
      () => next() * about.duration_s, () => time + 0.05, () => time - 0.05,
      () => events[Math.floor(next() * events.length)].time_s - about.began_s,
      () => windows[Math.floor(next() * windows.length)].from_s,
    ];
    time = Math.min(Math.max(0, moments[number % moments.length]()), about.duration_s);
    recorded.seek(time);
    while (recorded.waits) await new Promise((done) => setTimeout(done, 5));
    const [its, all] = [state(recorded.run), played(time)];
    const differs = [...its].findIndex((each, index) => each !== all[index]);
    const there = [Math.max(0, differs - 80), differs + 80];
    if (its !== all) wrong.push([time, its.slice(...there), all.slice(...there)]);
  }
  window.fetch = ask;
  return [windows.length, wrong.slice(0, 1)];
}"""


# Refuses a window with a status, or does not answer if it is 0; returns how often it is asked for
# when the moment is shown again.
ASKED_AGAIN = """async ([name, status]) => {
  const { RecordedRun } = await import("./page/model/recorded_run.js");
  const recorded = new RecordedRun(name);
  await recorded.open(0);
  const { fetch } = window;
  let asked = 0;
  window.fetch = (path, ...rest) => {
    if (!path.includes(`${name}/events`)) return fetch(path, ...rest);
    asked++;
    if (!status) return Promise.reject(new TypeError("no network"));
    return Promise.resolve(new Response('{"code": "", "message": "", "hint": ""}', { status }));
  };
  const refused = new Promise((done) => recorded.addEventListener("error", done, { once: true }));
  recorded.seek(recorded.duration);
  await refused;
  asked = 0;
  recorded.seek(recorded.duration);
  window.fetch = fetch;
  return asked;
}"""


def run(served: Served, *tasks: int | Move) -> Path:
    """Run tasks; return the folder of recordings."""
    for task in tasks:
        served.executive.result(served.executive.send(task).identity)
    folder = served.folder / "recordings"
    at_rest(folder)
    return folder


def moment(tab: Tab) -> float:
    return float(tab.evaluate("Number(document.getElementById('moment').value)"))


def test_a_state_from_windows_is_that_of_playing_everything(
    open_page: Open, page_server: Served
) -> None:
    folder = run(page_server, 2)
    source = max(folder.glob("*Z-2.mcap"))
    write_long(source, folder / LONG, MESSAGES)
    tab = open_page()
    windows, wrong = tab.evaluate(SAME_STATES, [LONG, 40, False])
    assert windows > 5
    assert wrong == []
    assert tab.evaluate(SAME_STATES, [source.name, 20, False])[1] == []
    assert tab.evaluate(SAME_STATES, [source.name, 200, True])[1] == []
    # A deleted recording is not asked for again; one that the server refused for a while is.
    asked = [tab.evaluate(ASKED_AGAIN, [LONG, status]) for status in (404, 401, 429, 0)]
    assert asked == [0, 1, 1, 1]
    tab.context.close()  # it may still load what comes next
    (folder / LONG).unlink()


def test_a_recording_is_found_played_and_linked(open_page: Open, page_server: Served) -> None:
    run(page_server, 0, 13, 12)
    tab = open_page()
    shows(tab, "#shown", "^task 12 say, recorded$")
    shows(tab, "#positions", r"joint_1\s*-?\d")  # the pose at its start, though nothing moved
    tab.fill("#runs-search", "task 0")
    shows(tab, "#runs li:first-child", "task 0 home")
    tab.focus("#runs button >> nth=0")
    tab.keyboard.press("Enter")
    shows(tab, "#shown", "^task 0 home, recorded$")
    expect(tab, "#runs .run[aria-current]").to_be_focused()  # keys go on from there
    end = moment(tab)
    assert end > 0.5
    is_accessible(tab)
    tab.focus("#moment")
    tab.keyboard.press("Home")
    shows(tab, "#moment-words", "^0.00 of ")
    shows(tab, "#running", "nothing|home")
    assert tab.locator("#tree .row[data-status='SUCCESS']").count() == 0
    moments = [0.0]
    for _ in range(4):
        tab.keyboard.press(".")
        tab.wait_for_function(f"() => document.getElementById('moment').value > {moments[-1]}")
        moments.append(moment(tab))
    tab.keyboard.press(",")
    tab.wait_for_function(f"() => document.getElementById('moment').value == {moments[-2]}")
    tab.focus("#runs .run >> nth=0")
    tab.keyboard.press(".")  # as in the player
    tab.wait_for_function(f"() => document.getElementById('moment').value == {moments[-1]}")
    tab.focus("#log-search")
    tab.keyboard.type("k,.")  # which are letters there
    assert tab.input_value("#log-search") == "k,."
    assert moment(tab) == moments[-1]
    tab.select_option("#speed", "0.1")
    tab.click("#play")
    shows(tab, "#play", "^Pause$")
    tab.select_option("#speed", "10")
    shows(tab, "#play", "^Play$")  # it stops at the end
    shows(tab, "#moment-words", f"^{end:.2f} of {end:.2f} s$")
    shows(tab, "#tree .row[data-status='SUCCESS'] .name", "home")
    name = tab.inner_text("#player-name")
    link = f"{page_server.server.url}/#recording={name}&t=0.3"
    other = open_page(link)
    shows(other, "#moment-words", "^0.30 of ")
    expect(other, "#delete").to_be_disabled()
    # A goal that begins does not take a recording away that was opened.
    page_server.executive.result(page_server.executive.send(11).identity)
    shows(other, "#goal-title", "nothing")
    assert re.search("home, recorded", other.inner_text("#shown"))
    other.click("#live")
    other.locator("#player").wait_for(state="hidden")


def test_a_run_whose_recording_is_being_finished_is_shown_next(
    open_page: Open, page_server: Served
) -> None:
    run(page_server, 11, 13)

    def finishing(asked: Any) -> None:
        """Answer as a server that has not finished the newest recording yet."""
        listed = asked.fetch().json()
        listed["recordings"][0] |= {"state": "UNFINISHED", "code": "log.in_use"}
        asked.fulfill(json=listed)

    tab = open_page(prepare=lambda empty: empty.route("**/api/recordings?*", finishing, times=1))
    shows(tab, "#shown", ".")
    assert tab.inner_text("#shown") == "task 13 fail, recorded"  # and not the run before
    shows(tab, "#failure", "13_fail.yaml:5")


def test_broken_recordings_and_bombs_are_refused(open_page: Open, page_server: Served) -> None:
    folder = run(page_server, 11)
    whole = max(folder.glob("*Z-11.mcap")).read_bytes()
    bombs = {
        "zeros": BOMBS["zeros in many chunks"](),
        "zeros-cut": BOMBS["zeros in many chunks"]()[:-8],
        "many": BOMBS["empty messages"](),
        "deep": BOMBS["deep JSON"](),
        "deep-cut": BOMBS["deep JSON"]()[:-8],
        "long": BOMBS["a long record"](),
        "empty": b"",
        "text": b"<script>alert(1)</script>",
        "damaged": whole[: len(whole) // 2] + bytes(64) + whole[len(whole) // 2 + 64 :],
    }
    for name, data in bombs.items():
        (folder / f"{name}.mcap").write_bytes(data)
    (folder / "cut.mcap").write_bytes(whole[:-100])
    tab = open_page()
    for name in bombs:
        tab.click(f"#runs .run[title^='{name}.mcap']")
        shows(tab, "#control-error", rf"{name}\.mcap: ")
    tab.click("#runs .run[title^='cut.mcap']")
    shows(tab, "#player-name", r"^cut\.mcap$")  # all of it, but its index
    shows(tab, "#shown", "nothing, recorded")
    assert tab.inner_text("#control-error") == ""
    tab.click("#runs .run:has(.name:text-is('task 11 nothing')) >> nth=-1")
    shows(tab, "#shown", "^task 11 nothing, recorded$")
    tab.select_option("#compare", "cut.mcap")
    tab.locator("#comparison").wait_for()
    tab.context.close()  # it may still load the robot
    forget(tab, "409")
    for name in (*bombs, "cut"):
        (folder / f"{name}.mcap").unlink()


def test_two_recordings_are_compared_at_one_moment(open_page: Open, page_server: Served) -> None:
    moves = [Move((f"joint_1={angle}deg",), False, 1.0) for angle in (10, 20, 10)]
    run(page_server, *moves)
    tab = open_page(viewport={"width": 390, "height": 844}, color_scheme="dark")
    shows(tab, "#shown", "^move joint_1=10deg, recorded$")
    assert tab.evaluate("document.getElementById('player').offsetHeight") < 100
    tab.check("#more")
    tab.select_option("#compare", index=1)
    tab.locator("#time-panel").scroll_into_view_if_needed()
    shows(tab, "#plots figcaption span", "^Position .deg.; dotted: the other run$")
    assert tab.evaluate("document.documentElement.scrollWidth") == 390  # nothing is cut
    shows(tab, "#comparison tr", r"joint_1 *1\d\.\d° *[12]\d\.\d° *-\d+\.\d°")
    is_accessible(tab)
    tab.focus("#moment")
    tab.keyboard.press("Home")
    shows(tab, "#comparison tr", r"joint_1 *20\.0° *10\.0°")  # where the goals began
    tab.select_option("#compare", "")
    shows(tab, "#plots figcaption span", "^Position .deg.$")
    tab.locator("#comparison").wait_for(state="hidden")


TOPS = """['left', 'failure', 'comparison', 'now'].map((id) =>
  document.getElementById(id)).filter((each) => !each.hidden).map((each) =>
  Math.round(each.getBoundingClientRect().top))"""


def test_the_column_on_the_right_has_no_hole(open_page: Open, page_server: Served) -> None:
    run(page_server, 13, 13, 11)
    tab = open_page()

    def tops(width: int) -> list[int]:
        tab.set_viewport_size({"width": width, "height": 800})
        return list(tab.evaluate(TOPS))

    shows(tab, "#shown", "nothing, recorded")
    for width in (1000, 1280):
        left, now = tops(width)
        assert now == left
    tab.click("#runs .run:has-text('task 13')")
    shows(tab, "#shown", "^task 13 fail, recorded$")
    tab.select_option("#compare", index=2)
    tab.locator("#comparison").wait_for()
    for width in (1000, 1280):
        left, failure, comparison, now = tops(width)
        assert left == failure < comparison < now < failure + 700


def test_another_comparison_is_plotted(open_page: Open, page_server: Served) -> None:
    run(page_server, *[Move((f"joint_1={angle}deg",), False, 1.0) for angle in (0, 10, 20, 10)])
    tab = open_page()
    shows(tab, "#shown", "^move joint_1=10deg, recorded$")
    tab.locator("#time-panel").scroll_into_view_if_needed()
    canvas = tab.locator("#plots canvas").first
    plotted = "document.querySelector('#plots canvas').toDataURL() === second"

    def compare(index: int) -> str:
        tab.select_option("#compare", "")
        shows(tab, "#plots figcaption span", "^Position .deg.$")
        tab.select_option("#compare", index=index)
        shows(tab, "#plots figcaption span", "dotted")
        return str(canvas.evaluate("each => each.toDataURL()"))

    second = compare(2)
    assert compare(1) != second
    tab.select_option("#compare", index=2)
    tab.wait_for_function(f"second => {plotted}", arg=second)


def test_what_is_done_with_a_recording(open_page: Open, page_server: Served) -> None:
    folder = run(page_server, 0)
    no_clipboard = "Object.defineProperty(navigator, 'clipboard', {value: undefined})"
    tab = open_page(prepare=lambda empty: empty.add_init_script(no_clipboard))
    shows(tab, "#shown", "^task 0 home, recorded$")
    name = tab.inner_text("#player-name")
    tab.click("#link")
    shows(tab, "#player-note", "^Copy the address of this page: it opens this moment.$")
    assert f"#recording={name}&t=" in tab.url
    with tab.expect_download() as download:
        tab.click("#download")
    assert download.value.suggested_filename == name
    assert Path(download.value.path()).read_bytes() == (folder / name).read_bytes()
    tab.click("#pin")
    shows(tab, "#player-note", "never deleted")
    shows(tab, "#runs .name", "◆ task 0 home")
    tab.click("#delete")
    shows(tab, "#player-note", "is pinned; unpin it first$")
    forget(tab, "409")
    tab.click("#pin")
    shows(tab, "#player-note", "No longer pinned")
    tab.click("#verify")
    shows(tab, "#player-note", "plan -> frames holds.*goal -> plan holds")
    asked = list[str]()
    tab.on("request", lambda each: asked.append(each.url))
    tab.context.set_offline(True)
    shows(tab, "#connection", "No connection")
    with tab.expect_response("**/api/robot"):
        tab.context.set_offline(False)
    tab.focus("#delete")
    tab.keyboard.press("Enter")
    shows(tab, "#runs-note", "^Deleted task 0 home.*Undo$")
    expect(tab, "#runs-note button").to_be_focused()
    tab.locator("#player").wait_for(state="hidden")
    assert not (folder / name).exists()
    assert name not in tab.url  # which the next stream would open
    is_accessible(tab)
    tab.keyboard.press("Enter")
    shows(tab, "#runs-note", "^Restored task 0 home")
    assert (folder / name).exists()
    assert f"{tab.url}api/recordings/{name}/robot" not in asked  # it may be deleted by then
    forget(tab, "ERR_INTERNET_DISCONNECTED")


def test_recordings_are_viewed_without_an_arm(open_page: Open, page_server: Served) -> None:
    folder = run(page_server, 13)
    newest = max(folder.glob("*Z-13.mcap"))
    with Viewer(folder, page_server.clock) as viewer:
        viewer.start()
        held: dict[str, Any] = {}

        def hold(route: Any) -> None:
            held["health"] = route

        link = f"{viewer.sign_in.link()}&recording={newest.name}&t=0"
        tab = open_page(link, lambda tab: tab.route("**/api/health", hold, times=1), webgl=True)
        shows(tab, "#session", "signed in")  # before it knows that there is no arm
        held["health"].continue_()
        shows(tab, "#shown", "^task 13 fail, recorded$")
        shows(tab, "#robot", "arduinobot")
        shows(tab, ".no-arm-only dd", "recordings only, no arm")
        for part in ("#stop", "#port", "#tasks", "#move", "#pause", "#live"):
            assert tab.is_hidden(part)
        tab.locator("#arm canvas").wait_for()
        is_accessible(tab)
        tab.focus("#moment")
        tab.keyboard.press("End")
        shows(tab, "#failure", "fail failed.*13_fail.yaml:5")
        tab.keyboard.press("Escape")  # stops nothing
        shows(tab, "#session", "signed in")
        expect(tab, "#delete").to_be_enabled()
        listed = tab.locator("#runs .run").count()
        another = newest.with_name("20990101T000000.000Z-13.mcap")
        another.write_bytes(newest.read_bytes())
        tab.evaluate("dispatchEvent(new Event('focus'))")  # back from a terminal
        expect(tab, "#runs .run").to_have_count(listed + 1)
        tab.context.close()
        another.unlink()


def test_a_verdict_is_shown_with_its_own_recording(open_page: Open, page_server: Served) -> None:
    run(page_server, 11, 13)
    held: list[Any] = []

    def hold(asked: Any) -> None:
        held.append(asked)

    tab = open_page(prepare=lambda empty: empty.route("**/verify", hold))
    shows(tab, "#shown", "^task 13 fail, recorded$")
    with tab.expect_request("**/verify"):
        tab.click("#verify")
    tab.click("#runs .run:has(.name:text-is('task 11 nothing')) >> nth=0")
    shows(tab, "#shown", "^task 11 nothing, recorded$")
    with tab.expect_response("**/verify"):
        held[0].fulfill(json={"verdicts": [], "error": "of the first"})
    tab.wait_for_timeout(300)  # until it would be shown
    assert tab.inner_text("#player-note") == ""


def test_more_recordings_stay_listed(open_page: Open, page_server: Served) -> None:
    folder = run(page_server, 11)
    source = max(folder.glob("*Z-11.mcap")).read_bytes()
    copies = [folder / f"20260101T0000{second:02}.000Z-11.mcap" for second in range(60)]
    for each in copies:
        each.write_bytes(source)
    tab = open_page()
    expect(tab, "#runs .run").to_have_count(50)
    tab.click("#runs-more")
    expect(tab, "#runs .run").not_to_have_count(50)
    listed = tab.locator("#runs .run").count()
    tab.focus("#runs .run >> nth=-1")
    run(page_server, 11)
    expect(tab, "#runs .run").to_have_count(listed + 1)
    expect(tab, "#runs .run >> nth=-1").to_be_focused()
    for each in copies:
        each.unlink()
