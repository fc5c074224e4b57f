"""The page of a server in Chromium: one browser for all tests, one server for each module."""

import asyncio
import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from executive.api import Policy
from hardware import RealClock, Robot
from skills.motion import Pool
from tests.support.servers.browsing import Open, Tab
from tests.support.servers.serving import Served

_WITHOUT_WEBGL = """{
  const { getContext } = HTMLCanvasElement.prototype;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...rest);
  };
}"""

CHROMIUM = shutil.which("chromium")


@pytest.fixture(scope="session")
def chromium() -> Iterator[tuple[Any, asyncio.AbstractEventLoop | None]]:
    """The browser, and the event loop that its library needs running in this thread."""
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # WebGL by the processor, as on a machine without a graphics card.
        args = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        args += ["--disable-gpu-compositing"]  # the page itself is drawn in half the time
        args += ["--host-resolver-rules=MAP *.example 127.0.0.1"]  # as an attacker's DNS server
        launched = playwright.chromium.launch(executable_path=CHROMIUM, args=args)
        loop = asyncio._get_running_loop()
        asyncio._set_running_loop(None)
        yield launched, loop
        asyncio._set_running_loop(loop)
        launched.close()


@pytest.fixture
def browser(chromium: tuple[Any, asyncio.AbstractEventLoop | None]) -> Iterator[Any]:
    """The browser; its event loop runs only meanwhile, or it would refuse those of other tests."""
    launched, loop = chromium
    asyncio._set_running_loop(loop)
    yield launched
    asyncio._set_running_loop(None)


@pytest.fixture(scope="module")
def page_server(
    quick_robot: Robot,
    real_pool: Pool,
    real_clock: RealClock,
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Served]:
    """A server with an active arm, for all tests of a module."""
    folder = tmp_path_factory.mktemp("page")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        served = Served(quick_robot, real_pool, folder, real_clock)
        served.start(Policy.REJECT, active=True)
        yield served
        served.stop()


@pytest.fixture
def open_page(browser: Any, page_server: Served) -> Iterator[Open]:
    """Opens tabs. No tab may report an error, or ask another server for anything."""
    problems: list[str] = []
    contexts = []

    def note(problem: str, is_one: bool) -> None:
        problems.extend([problem] if is_one else [])

    def open_tab(
        link: str = "", prepare: Callable[[Tab], object] = id, webgl: bool = False, **options: Any
    ) -> Tab:
        """Open a link, by default one that signs in; `prepare` gets the empty tab before."""
        context = browser.new_context(**options)
        if not webgl:  # drawn by the processor, the arm would take most of the time of a test
            context.add_init_script(_WITHOUT_WEBGL)
        context.set_default_timeout(20_000)  # also on a busy machine
        contexts.append(context)
        tab = context.new_page()
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.on(
            "console",
            lambda line: note(line.text, line.type == "error" and "WebGL" not in line.text),
        )
        address = link or page_server.server.sign_in.link()
        own = (address.partition("#")[0].rstrip("/"), "data:", "blob:")
        tab.on("request", lambda asked: note(asked.url, not asked.url.startswith(own)))
        prepare(tab)
        tab.goto(address)
        tab.problems = problems
        return tab

    yield open_tab
    for goal in page_server.executive.cancel().goals:
        page_server.executive.result(goal)  # the next test sends one
    for path in page_server.executive.status().breakpoints:  # of a test that ended early
        page_server.executive.break_at(path, False)
    for tab in (tab for context in contexts for tab in context.pages):
        tab.unroute_all(behavior="ignoreErrors")  # a request that a test changes may be under way
        tab.evaluate("0")  # what it reported before has arrived then
    seen = list(problems)  # what a tab still loads fails as it closes
    for context in contexts:
        context.close()
    assert seen == []
