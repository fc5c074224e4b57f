"""The page of a server, in headless Chromium on the same machine.

`page_transfer_kb`: all that a first view loads, as it is sent. `page_interactive_s`: from the start
of the navigation, without a cache, until the state of the arm is shown.
`event_to_pixel_ms`: from an event of the executive to the frame of the screen that shows it.
`stop_click_ms`: from the click on STOP to the hold frame on the wire, while the arm moves and the
tree has 1,000 nodes. `*_p95`, `*_p99`: that share of the samples is at most as large.
`page_memory_mb`: memory of the page's code after garbage collection, before many goals;
`page_memory_growth_mb`: how much more it is after them.
`server_cost_percent`: processor time of the server for one page that watches a motion at 10 frames
a second, less that of a motion that nobody watches.
`recording_open_s`: from the choice of a recording of 10^6 messages until its end is shown, by a
server that has not read it before. `scrub_frame_ms`: time between two frames of the screen while
its scrubber moves over all of it. Without a graphics card, each of them draws only the player.
The browser has no flag that says how it draws: `--use-angle=swiftshader` would make it take an
emulated graphics card for a real one, and draw the whole page with it, at four times the cost.
"""

import os
import re
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

# Files beside this one are named like rooms, and this folder comes first when run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

import logs
from executive.api.events import Event
from executive.api.move import Move
from executive.cli.support.process import make_punctual
from tests.bench.table import Row, arguments, show
from tests.support.recordings.finished import at_rest
from tests.support.recordings.long_recording import write_long
from tests.support.servers.serving import Served, serving

TICKS, LARGE = 30, 31  # numbers of tasks
MESSAGES = 1_000_000  # of a long recording
STEPS = 50
WARM_UP, GOALS = 60, 200  # before the memory is measured first, and between

# Notes when a message is on the screen: after the frame that follows the change.
WATCH = """() => {
  window.seen = {};
  window.watching?.disconnect();
  window.watching = new MutationObserver(() => {
    const found = document.getElementById('running').textContent.match(/tick \\d+/g) ?? [];
    const more = [...document.querySelectorAll('#tree .message')].map((each) => each.textContent);
    for (const text of [...found, ...more.filter((each) => each.startsWith('tick'))])
      if (!(text in seen)) {
        seen[text] = 0;
        requestAnimationFrame(() => setTimeout(() => {
          seen[text] = performance.timeOrigin + performance.now();
        }));
      }
  });
  watching.observe(document.body, {subtree: true, childList: true, characterData: true});
}"""
CLICK = """() => {
  const at = performance.timeOrigin + performance.now();
  document.getElementById('stop').click();
  return at;
}"""


# Moves the scrubber a little in every frame, and returns the times between frames [ms].
SCRUB = """() => new Promise((done) => {
  const moment = document.getElementById('moment');
  const times = [];
  let before = 0;
  const next = (now) => {
    if (before) times.push(now - before);
    before = now;
    if (times.length === 240) return done(times);
    moment.value = Number(moment.max) * Math.abs(1 - times.length / 120);
    moment.dispatchEvent(new Event('input'));
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""
OPEN = """(name) => new Promise((done, fail) => {
  const begun = performance.now();
  const text = (id) => document.getElementById(id).textContent;
  const look = () => {
    if (text('control-error')) fail(new Error(text('control-error')));
    else if (text('player-name') === name) done(performance.now() - begun);
    else requestAnimationFrame(look);
  };
  document.querySelector(`#runs .run[title^='${name}']`).click();
  look();
})"""


def write_tasks(folder: Path) -> None:
    head = "task: {}\nname: {}\ndescription: Measured.\ntree:\n  sequence:\n"
    wait, say = "    - Wait: {duration: 40 ms}\n", "    - Say: {text: tick %d}\n"
    ticks = "".join(say % number + wait for number in range(STEPS))
    (folder / "30_ticks.yaml").write_text(head.format(TICKS, "ticks") + ticks)
    many = "".join(say % number for number in range(980))
    move = (
        "    - subtree: move_joints\n      with: {joints: {joint_1: %d deg}}\n      name: to_%d\n"
    )
    moves = "".join(move % (angle, angle) for angle in (80, -80))
    (folder / "31_large.yaml").write_text(head.format(LARGE, "large") + many + moves)


class Watcher:
    """Events of the executive with their times [ms since 1970]."""

    def __init__(self, served: Served) -> None:
        self._clock, self._epoch = served.clock, served.clock.epoch_ns()
        self.events: list[tuple[float, Event]] = []
        served.executive.subscribe(lambda event: self.events.append((self.now(), event)))

    def now(self) -> float:
        return self._epoch / 1e6 + self._clock.now() * 1e3


def first_views(browser: Any, served: Served, runs: int) -> tuple[list[float], list[float]]:
    """What first views load [kB], and how long they take [s]."""
    sizes, times = [], []
    for _ in range(runs):
        context = browser.new_context()
        tab = context.new_page()
        loaded: list[float] = []
        network = context.new_cdp_session(tab)
        network.send("Network.enable")
        network.on(
            "Network.loadingFinished", lambda end, to=loaded: to.append(end["encodedDataLength"])
        )
        tab.goto(served.server.sign_in.link(), wait_until="commit")
        ready = "() => document.getElementById('arm-state')?.textContent === 'active'"
        tab.wait_for_function(f"{ready} && (window.ready ??= performance.now())")
        times.append(tab.evaluate("window.ready") / 1e3)
        tab.locator("#arm canvas").wait_for()
        tab.wait_for_timeout(500)
        sizes.append(sum(loaded) / 1e3)
        context.close()
    return sizes, times


def pixels(tab: Any, served: Served, runs: int) -> list[float]:
    """Times from an event to the screen [ms]."""
    found = []
    for _ in range(runs):
        served.executive.result(served.executive.send(11).identity)  # no tick is shown any more
        tab.wait_for_timeout(500)
        watcher = Watcher(served)
        tab.evaluate(WATCH)
        served.executive.result(served.executive.send(TICKS).identity)
        tab.wait_for_timeout(500)
        seen = tab.evaluate("window.seen")
        for at, event in watcher.events:
            if isinstance(event, logs.NodeStatus) and re.fullmatch(r"tick \d+", event.message):
                found.append(seen[event.message] - at)
    return found


def stops(tab: Any, served: Served, count: int) -> list[float]:
    """Times from the click to the hold frame [ms]."""
    found = []
    for _ in range(count):
        watcher = Watcher(served)
        goal = served.executive.send(LARGE).identity
        while sum(isinstance(event, logs.Sent) for _, event in watcher.events) < 5:
            tab.wait_for_timeout(20)
        clicked = tab.evaluate(CLICK)
        served.executive.result(goal)
        held = [at for at, event in watcher.events if isinstance(event, logs.Sent) and event.hold]
        found += [held[0] - clicked] if held else []
    return found


def memory(context: Any, tab: Any, served: Served) -> list[float]:
    """Memory before many goals, and after them [MB]."""
    session = context.new_cdp_session(tab)
    found = []
    for goals in (WARM_UP, GOALS):
        for _ in range(goals):
            served.executive.result(served.executive.send(11).identity)
        tab.wait_for_timeout(3000)  # until its timers have ended, which hold requests
        for _ in range(2):  # what the first frees holds more
            session.send("HeapProfiler.collectGarbage")
        found.append(session.send("Runtime.getHeapUsage")["usedSize"] / 1e6)
    return found


def motion_cost(served: Served) -> float:
    """Processor time during a motion over its duration [%]."""
    for angle in ("-80deg", "80deg"):
        begun, used = time.monotonic(), time.process_time()
        served.executive.result(
            served.executive.send(Move((f"joint_1={angle}",), False, 0.4)).identity
        )
    return 100 * (time.process_time() - used) / (time.monotonic() - begun)


def recordings(tab: Any, served: Served, runs: int) -> tuple[list[float], list[float]]:
    """Times to open long recordings [s], and between frames while scrubbing [ms]."""
    folder = served.folder / "recordings"
    served.executive.result(served.executive.send(2).identity)
    at_rest(folder)
    source = max(folder.glob("2*-2.mcap"), key=lambda each: each.stat().st_mtime)
    write_long(source, long := served.folder / "long", MESSAGES)
    opened, frames = [], []
    for number in range(runs):
        path = folder / f"209901{number + 10}T000000.000Z-2.mcap"
        path.hardlink_to(long)  # under a name that the server does not know
        tab.fill("#runs-search", path.name)
        tab.locator(f"#runs .run[title^='{path.name}']").wait_for()
        opened.append(tab.evaluate(OPEN, path.name) / 1e3)
        frames += tab.evaluate(SCRUB)
        path.unlink()
    return opened, frames


def share(samples: Sequence[float], part: float) -> float:
    """The value that this part of the samples does not exceed."""
    return sorted(samples)[min(len(samples) - 1, int(part * len(samples)))]


def main(runs: int, file: Path | None) -> None:
    """Measure and show."""
    make_punctual()  # of the server's threads, as `armtree serve` does
    with serving() as served:
        os.setpriority(os.PRIO_PROCESS, 0, 0)  # of this thread, and the browser
        measure(served, runs, file)


def measure(served: Served, runs: int, file: Path | None) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        write_tasks(served.tasks)
        alone = [motion_cost(served) for _ in range(3)]
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        sizes, times = first_views(browser, served, runs)
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        tab = context.new_page()
        tab.goto(served.server.sign_in.link())
        tab.locator("#arm canvas").wait_for()
        watched = [motion_cost(served) for _ in range(3)]
        shown = pixels(tab, served, max(1, runs // 3))
        stopped = stops(tab, served, 15 * runs)  # a hundred, for a p99
        before, after = memory(context, tab, served)
        opened, frames = recordings(tab, served, max(1, runs // 5))
        browser.close()
    costs = [b - a for a, b in zip(sorted(alone), sorted(watched), strict=True)]
    rows = [
        Row("page_transfer_kb", "kB", sizes, 400),
        Row("page_interactive_s", "s", times, 0.8),
        Row("event_to_pixel_ms", "ms", shown),
        Row("event_to_pixel_p95", "ms", [share(shown, 0.95)], 50),
        Row("stop_click_ms", "ms", stopped),
        Row("stop_click_p99", "ms", [share(stopped, 0.99)], 30),
        Row("recording_open_s", "s", opened, 2),
        Row("scrub_frame_ms", "ms", frames, 17),  # 60 frames a second
        Row("scrub_frame_p95", "ms", [share(frames, 0.95)]),
        Row("page_memory_mb", "MB", [before]),
        Row("page_memory_growth_mb", "MB", [after - before], 1),
        Row("server_cost_percent", "%", costs, 1),
    ]
    show(rows, file)


if __name__ == "__main__":
    given = arguments(__doc__ or "").parse_args()
    main(given.runs, given.json)
