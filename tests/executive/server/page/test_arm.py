"""The arm in 3D in a browser: pose, path, refused plans, views, and broken meshes."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from numpy.typing import NDArray

from executive.api.move import Move
from tests.support.paths import ROOT
from tests.support.servers.browsing import Open, Tab, is_accessible, shows
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = [
    "tests.support.servers.server_fixtures",
    "tests.support.servers.browser_fixtures",
]

BLUE = (28, 95, 196)  # of the path


def picture(tab: Tab) -> NDArray[np.int_]:
    """The canvas as it is seen (H, W, RGB), 0 to 255."""
    data = imread(io.BytesIO(tab.locator("#arm").screenshot()), "png")
    return np.asarray(255 * data[..., :3]).astype(int)


def until_seen(tab: Tab, right: Callable[[NDArray[np.int_]], bool]) -> NDArray[np.int_]:
    """Wait until the picture is right: a busy machine draws late."""
    for _ in range(200):
        if right(pixels := picture(tab)):
            return pixels
        tab.wait_for_timeout(100)
    raise AssertionError("the picture does not become right")


def changed(before: NDArray[np.int_], after: NDArray[np.int_]) -> NDArray[np.bool_]:
    """Which pixels have another colour."""
    found: NDArray[np.bool_] = np.abs(after - before).max(axis=-1) > 40
    return found


def is_drawn(pixels: NDArray[np.int_]) -> bool:
    return len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50


def is_refused(pixels: NDArray[np.int_], before: NDArray[np.int_]) -> bool:
    red = (pixels[..., 0] > 2 * pixels[..., 1]) & (pixels[..., 0] > 2 * pixels[..., 2])
    return bool((changed(before, pixels) & red).sum() > 300)


def count(pixels: NDArray[np.int_], colour: tuple[int, int, int], within: int = 40) -> int:
    return int((np.abs(pixels - colour).max(axis=-1) <= within).sum())


def height(pixels: NDArray[np.int_]) -> float:
    """The part of the picture's height that has something orange."""
    orange = (pixels[..., 0] > 1.5 * pixels[..., 2]) & (pixels[..., 0] > 100)
    rows = np.flatnonzero(orange.any(axis=1))
    return float(np.ptp(rows) / len(pixels)) if len(rows) else 0.0


def moved(served: Served, *words: str) -> None:
    acceptance = served.executive.send(Move(words, False, 1.0))
    served.executive.result(acceptance.identity)


def test_pose_path_and_refused_plans_are_drawn(open_page: Open, page_server: Served) -> None:
    tab = open_page(webgl=True)
    shows(tab, "#positions", r"joint_1\s*0\.0°")
    tab.locator("#arm canvas").wait_for()
    # The orange links; base and gripper fill the rest.
    before = until_seen(tab, lambda now: height(now) > 0.35)
    assert count(before, BLUE) == 0
    moved(page_server, "joint_1=70deg")
    shows(tab, "#positions", r"joint_1\s*70\.\d°")
    shows(tab, "#goal-state", "^done$")
    after = until_seen(tab, lambda now: count(now, BLUE) > 20 and changed(before, now).sum() > 500)
    tab.focus("#arm")
    tab.keyboard.press("ArrowLeft")
    turned = until_seen(tab, lambda now: changed(after, now).sum() > 500)
    tab.keyboard.press("+")
    after = until_seen(tab, lambda now: changed(turned, now).sum() > 500)
    tab.click("#view-top")
    above = until_seen(tab, lambda now: changed(after, now).sum() > 500)
    moved(page_server, "joint_2=-90deg", "joint_3=-90deg")
    shows(tab, "#failure", "base_plate would be up to .* deep in horizontal_arm")
    shows(tab, "#refused-note", "and the refused goal")
    until_seen(tab, lambda now: is_refused(now, above))  # the arm has not moved
    is_accessible(tab)


def test_bodies_have_their_meshes_and_a_measured_pose_is_a_ghost(
    open_page: Open, page_server: Served
) -> None:
    beam = ROOT / "tests" / "data" / "beam.stl"
    (page_server.tasks / "41_beam.yaml").write_text(
        "task: 41\nname: beam\ndescription: Add a beam, then move.\ntree:\n  sequence:\n"
        f"    - AddMesh: {{body: beam, file: {beam}, position: [0.3, 0.3, 0.2]}}\n"
        "    - subtree: move_joints\n      with: {joints: {joint_1: -20 deg}}\n"
        "    - RemoveBody: {body: beam}\n"
    )

    def measure(route: Any) -> None:
        status = route.fetch().json()
        status["measured"] = {name: q - 0.5 for name, q in status["commanded"].items()}
        route.fulfill(json=status)

    tab = open_page(webgl=True)
    tab.locator("#arm canvas").wait_for()
    beam_task = "#tasks li:has(.name:text-is('41 beam'))"
    tab.click(f"{beam_task} summary")
    with tab.expect_response("**/api/meshes/*beam.stl") as asked:
        tab.click(f"{beam_task} button:text-is('Dry run')")
    assert asked.value.body() == beam.read_bytes()
    page_server.executive.result(page_server.executive.send(41).identity)
    tab.reload()  # it shows the recording, which has its own copy
    with tab.expect_response("**/api/meshes/*beam.stl") as asked:
        shows(tab, "#shown", "beam, recorded")
    assert asked.value.body() == beam.read_bytes()
    tab.click("#live")
    before = until_seen(tab, is_drawn)
    tab.route("**/api/status", measure)
    shows(tab, "#measured-note", "and the measured one as a ghost")
    until_seen(tab, lambda now: changed(before, now).sum() > 200)


# Contrast of the darkest part of the arm to what is behind it.
CONTRAST = """async () => {
  const { shapes } = await (await fetch("/api/robot")).json();
  const light = (rgb) => [0.2126, 0.7152, 0.0722].reduce((sum, part, index) =>
    sum + part * ((rgb[index] + 0.055) / 1.055) ** 2.4, 0);
  const colors = shapes.map((each) => each.color).filter(Boolean);
  const darkest = Math.min(...colors.map(light));
  const { backgroundColor } = getComputedStyle(document.querySelector("#arm canvas"));
  const behind = light(backgroundColor.match(/[0-9.]+/g).map((each) => each / 255));
  return (behind + 0.05) / (darkest + 0.05);
}"""


def test_a_mesh_that_is_not_one_leaves_the_rest(open_page: Open) -> None:
    served = []

    def break_mesh(route: Any) -> None:
        served.append(route.request.url)
        route.fulfill(body="solid <script>alert(1)</script>" * 50)

    def name_mesh(route: Any) -> None:
        robot = route.fetch().json()
        robot["shapes"][0] |= {"kind": "mesh", "mesh": "0" * 32, "sizes": [1, 1, 1]}
        route.fulfill(json=robot)

    def prepare(tab: Tab) -> None:
        tab.route("**/api/meshes/*", break_mesh)
        tab.route("**/robot", name_mesh)  # the live one, and that of the last recording

    tab = open_page(prepare=prepare, webgl=True, color_scheme="dark")
    shows(tab, "#positions", "joint_1")
    tab.locator("#arm canvas").wait_for()
    until_seen(tab, is_drawn)
    assert tab.evaluate(CONTRAST) > 1.8  # dark parts are seen in the dark
    assert any(each.endswith("0" * 32) for each in served)
