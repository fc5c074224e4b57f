"""Pictures of every view of the page, at three sizes, light and dark.

`python -m tests.support.generated.page_pictures FOLDER [VIEW ...]`. The view `page` is that of the
documentation, a moving picture of a recording that plays:
`python -m tests.support.generated.page_pictures docs/pages/assets page` takes it.
"""

import io
import logging
import re
import shutil
import sys
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

from PIL import Image

from executive.api.move import Move
from executive.cli.support.log_handler import recorded_log
from hardware import BoardLink
from tests.support.recordings.finished import at_rest, rest
from tests.support.servers.browsing import shows
from tests.support.servers.serving import TASKS, Served, serving

SIZES = {"phone": (390, 844), "laptop": (1280, 800), "wall": (1920, 1080)}
DOCUMENTED = "page"  # a moving picture of the size of a screen, taken alone
FRAMES, FRAME_MS = 25, 200  # of the moving picture
SCREEN: Any = {"width": 1280, "height": 800}  # of the moving picture
DESCRIPTION = 0x010E  # the tag of EXIF; the words of the page in the moving picture
DELIVER = """task: 20
name: deliver
description: Fail deep inside.
tree:
  sequence:
    - subtree: open_gripper
    - retry:
        sequence:
          - subtree: move_joints
            with: {joints: {joint_1: 10 deg}}
          - Fail: {reason: the thing is not there}
      attempts: 2
"""
LINES = "".join(f"        - Say: {{text: line {number}}}\n" for number in range(24))
LARGE = f"""task: 21
name: large
description: A thousand nodes.
tree:
  sequence:
{f"    - sequence:{chr(10)}{LINES}" * 40}    - Wait: {{duration: 1 h}}
"""


def views(served: Served) -> Iterator[tuple[str, Callable[[Any], object]]]:
    """Bring the server into each state; yield its name, and what a tab does then."""
    executive = served.executive
    (served.tasks / "20_deliver.yaml").write_text(DELIVER)
    (served.tasks / "21_large.yaml").write_text(LARGE)
    yield "nothing", id
    executive.result(executive.send(20).identity)
    yield "failed", lambda tab: tab.click("#failure .link")
    executive.result(
        executive.send(Move(("joint_2=-90deg", "joint_3=-90deg"), False, 1.0)).identity
    )
    yield "refused", id
    executive.result(executive.send(1).identity)
    yield "done", lambda tab: (tab.click("#move summary"), tab.click("#tasks summary >> nth=5"))
    executive.result(executive.send(0).identity)  # away from where the dry run ends
    yield "planned", plan_pick
    for angle in (20, 60):
        executive.result(executive.send(Move((f"joint_1={angle}deg",), False, 1.0)).identity)
    at_rest(served.folder / "recordings")
    yield "recording", show_middle
    yield "compared", compare
    yield "restored", delete_and_restore
    yield "verified", verify
    yield "unfinished", show_unfinished(served)
    goal = executive.send(21).identity
    while executive.status().node != "Wait":
        rest(served.clock, 0.01)
    yield "large", id
    executive.pause(goal)
    yield "paused", id
    executive.cancel()
    executive.result(goal)
    goal = executive.send(14).identity
    yield "question", id
    executive.cancel()
    executive.result(goal)
    yield "lost", lambda tab: (tab.context.set_offline(True), tab.wait_for_timeout(2500))


def plan_pick(tab: Any) -> None:
    task = "#tasks li:has(.name:text-is('1 pick'))"
    tab.click(f"{task} summary")
    tab.click(f"{task} button:text-is('Dry run')")
    shows(tab, "#shown", "dry run")


def show_middle(tab: Any) -> None:
    """Show the newest recording in its middle."""
    shows(tab, "#shown", "recorded")
    show_moment(tab, 0.5)


def show_moment(tab: Any, share: float) -> None:
    """Show the moment after a share of the recording, from 0 to 1."""
    tab.evaluate(
        f"moment = document.getElementById('moment'); moment.value = {share} * moment.max;"
        "moment.dispatchEvent(new Event('input'))"
    )


def show_acts(tab: Any) -> None:
    """Show the newest recording in its middle, and what is done with it also on a phone."""
    show_middle(tab)
    tab.locator("#more").evaluate("each => { each.checked = true }")


def compare(tab: Any) -> None:
    show_acts(tab)
    tab.select_option("#compare", index=1)
    shows(tab, "#comparison", "joint_1")


def delete_and_restore(tab: Any) -> None:
    show_acts(tab)
    tab.click("#delete")
    tab.click("#runs-note button")
    shows(tab, "#runs-note", "Restored")


def verify(tab: Any) -> None:
    show_acts(tab)
    tab.click("#verify")
    shows(tab, "#player-note", "goal -> plan")


def show_unfinished(served: Served) -> Callable[[Any], object]:
    """Write the recording of a run that was killed while it moved; return what shows it."""
    goal = served.executive.send(1).identity
    while served.executive.status().node != "Execute":
        rest(served.clock, 0.01)
    rest(served.clock, 2.0)
    killed = served.folder / "recordings" / "20991231T000000.000Z-1.mcap"
    killed.write_bytes(max(killed.parent.glob("*Z-1.mcap")).read_bytes())
    served.executive.result(goal)

    def show(tab: Any) -> None:
        tab.click(f"#runs .run[title^='{killed.name}']")
        shows(tab, "#shown", "recorded, incomplete")

    return show


def main(folder: Path, wanted: Collection[str]) -> None:
    """Write the pictures of some views; of all if none is named."""
    from playwright.sync_api import sync_playwright

    folder.mkdir(parents=True, exist_ok=True)
    logging.getLogger().setLevel(logging.INFO)
    BoardLink.port = "virtual"  # as a user sees it
    with (
        serving() as served,
        recorded_log(served.executive),
        sync_playwright() as playwright,
    ):
        args = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=args)
        if DOCUMENTED in wanted:
            film(browser, served, folder / f"{DOCUMENTED}.webp")
            return
        for name, act in views(served):
            if name in wanted or not wanted:
                for size, (width, height) in SIZES.items():
                    for scheme in ("light", "dark"):
                        view: Any = {"width": width, "height": height}
                        context = browser.new_context(viewport=view, color_scheme=scheme)
                        take(context, served, act, folder / f"{name}-{size}-{scheme}.png")


def film(browser: Any, served: Served, path: Path) -> None:
    """Take a moving picture of the recording of task 1; keep the words of the page with it."""
    run_pick(served)
    context = browser.new_context(viewport=SCREEN)
    tab = opened(context, served)
    shows(tab, "#shown", "recorded")
    frames = []
    for number in range(FRAMES):
        show_moment(tab, number / (FRAMES - 1))
        tab.wait_for_timeout(100)  # the arm and the plots are drawn
        frames.append(Image.open(io.BytesIO(tab.screenshot())).resize((960, 600)))
    exif = Image.Exif()
    exif[DESCRIPTION] = words(tab)
    durations = [FRAME_MS] * (FRAMES - 1) + [10 * FRAME_MS]
    rest: dict[str, Any] = {"append_images": frames[1:], "duration": durations, "exif": exif}
    frames[0].save(path, save_all=True, loop=0, quality=60, method=6, **rest)
    context.close()


def run_pick(served: Served) -> None:
    """Run task 1 with only the tasks that ship."""
    for name in TASKS:
        (served.tasks / name).unlink()
    served.executive.result(served.executive.send(1).identity)


def words(tab: Any) -> str:
    """Return what a tab shows, without numbers and without what differs between computers."""
    tab.evaluate(
        "for (const each of document.querySelectorAll('#port, #log, #no-3d, .when'))"
        "each.style.display = 'none'"
    )
    return " ".join(re.findall("[A-Za-z_]+", tab.inner_text("body")))


def opened(context: Any, served: Served) -> Any:
    """Return a new tab that is signed in and has drawn the arm."""
    tab = context.new_page()
    tab.goto(served.server.sign_in.link())
    tab.locator("#arm canvas").wait_for()
    tab.locator("#tasks li").first.wait_for()
    tab.wait_for_timeout(300)
    return tab


def take(context: Any, served: Served, act: Callable[[Any], object], path: Path) -> None:
    """Take a picture of a new tab after an act, and close the tab."""
    tab = opened(context, served)
    act(tab)
    tab.locator("#time-panel").scroll_into_view_if_needed()  # plots are drawn when they are seen
    tab.wait_for_timeout(100)
    # In a picture of the whole page, the player would hide what is behind it, and rows of the tree
    # that are not on the screen would be empty.
    tab.evaluate(
        "document.getElementById('player').style.position = 'static'; scrollTo(0, 0);"
        "for (const e of document.querySelectorAll('.row')) e.style.contentVisibility = 'visible'"
    )
    tab.screenshot(path=path, full_page=True)
    context.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
