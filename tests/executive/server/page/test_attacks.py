"""Attacks on the page in a browser: frames, DNS rebinding, foreign pages, and hostile texts."""

from typing import Any

import pytest

import logs
from tests.support.servers.browsing import Open, Tab, forget, is_accessible, shows
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

HOSTILE = "<img src=x onerror=alert(1)><script>alert(2)</script>"
LONG = 100_000  # bytes
TRY_ALL = """async (server) => {
  const tries = [
    fetch(`${server}/api/status`),
    fetch(`${server}/api/stop`, {method: "POST"}),
    fetch(`${server}/api/goals`, {method: "POST", body: '{"task": 11}'}),
    new Promise((open, fail) => {
      const socket = new WebSocket(server.replace("http", "ws"));
      socket.onopen = open;
      socket.onerror = fail;
    }),
    new Promise((open, fail) => {
      const source = new EventSource(`${server}/api/events`);
      source.onopen = open;
      source.onerror = () => { source.close(); fail(); };
    }),
  ];
  const found = await Promise.allSettled(tries);
  return found.map(({status, value}) => status === "fulfilled" ? value?.status ?? "open" : "none");
}"""


def foreign_page(browser: Any, address: str, html: str) -> Tab:
    """A tab that shows a page of another site."""
    tab = browser.new_context().new_page()
    tab.route(f"{address}/**", lambda route: route.fulfill(body=html, content_type="text/html"))
    tab.goto(f"{address}/")
    return tab


def test_other_sites_cannot_frame_read_or_command(browser: Any, page_server: Served) -> None:
    server = page_server.server.url
    frame = f'<iframe src="{server}/"></iframe>'
    tab = foreign_page(browser, "http://evil.example", frame)
    tab.wait_for_timeout(300)
    assert tab.frames[1].locator("#stop").count() == 0
    before = page_server.executive.goals()
    assert tab.evaluate(TRY_ALL, server) == ["none"] * 5
    tab.context.close()
    # DNS rebinding: the attacker's name now leads to this server, so the browser lets it read.
    port = page_server.server.port
    tab = browser.new_context().new_page()
    response = tab.goto(f"http://evil.example:{port}/")
    assert response.status == 403
    assert tab.locator("#stop").count() == 0
    assert tab.evaluate(TRY_ALL, f"http://evil.example:{port}") == ["none"] * 5
    assert page_server.executive.goals() == before
    tab.context.close()


def test_hostile_and_huge_texts_stay_texts(open_page: Open, page_server: Served) -> None:
    huge = f"{HOSTILE} {'long ' * (LONG // 5)}"
    (page_server.tasks / "40_hostile.yaml").write_text(
        f'task: 40\nname: hostile\ndescription: "{HOSTILE}"\ntree:\n  sequence:\n'
        f'    - Say: {{text: "{HOSTILE}"}}\n'
        f'    - Ask: {{question: "{HOSTILE}", wanted: "yes", choices: ["yes", "{HOSTILE}"]}}\n'
        f'    - Fail: {{reason: "{HOSTILE}"}}\n'
    )
    tab, executive = open_page(), page_server.executive
    executive.send(40)
    shows(tab, "#questions", "<script>alert.2.</script>")
    now = page_server.clock.now()  # a skill of the user may write such a message, or such a line
    executive.record(logs.NodeStatus(now, "hostile/ask", "ask", "RUNNING", huge))
    executive.record(logs.LogLine(now, 40, "armtree", huge))
    shows(tab, "#log", "error: <img src=x")
    tab.click("#questions button:text-is('yes')")
    shows(tab, "#failure", "hostile failed.*<script>alert.2.</script>")
    tab.click("#failure .link")
    shows(tab, "#node", "<script>")
    tab.click("#tasks summary:has-text('hostile')")
    assert tab.evaluate("document.querySelectorAll('img, main script').length") == 0
    assert tab.evaluate("document.body.innerText.length") < LONG / 2
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
    is_accessible(tab)
    tab.keyboard.press("Escape")
    shows(tab, "#stop-note", "^stopped at")


def test_a_robot_that_is_not_one_leaves_the_rest(open_page: Open, page_server: Served) -> None:
    header = bytes(80) + (2**31).to_bytes(4, "little")  # a mesh of two billion triangles

    def spoil(route: Any) -> None:
        robot = route.fetch().json()
        robot["shapes"][0] |= {"kind": "mesh", "mesh": "0" * 32, "sizes": [1, 1, 1]}
        robot["joints"][0]["parent"] = "nowhere"
        robot["links"][0] = HOSTILE
        route.fulfill(json=robot)

    def prepare(tab: Tab) -> None:
        tab.route("**/api/meshes/*", lambda route: route.fulfill(body=header + bytes(60)))
        tab.route("**/robot", spoil)

    tab = open_page(prepare=prepare, webgl=True)
    tab.locator("#arm canvas").wait_for()
    shows(tab, "#positions", "joint_1")
    tab.unroute_all(behavior="ignoreErrors")  # the robot of a recording may be under way
    wrong = {"code": "file.robot", "message": "arm.urdf is not XML", "hint": ""}
    tab.route("**/api/robot", lambda route: route.fulfill(status=422, json=wrong))
    tab.reload()
    shows(tab, "#no-3d", "The robot is not shown: arm.urdf is not XML")
    shows(tab, "#tasks", "home")
    forget(tab, "422")
    page_server.executive.send(10)
    shows(tab, "#running", "^wait$")
    tab.click("#stop")
    shows(tab, "#goal-state", "^canceled$")
