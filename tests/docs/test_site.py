"""The documentation site builds without a warning, loads nothing from elsewhere, and is found."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from tests.support.paths import ROOT

pytest_plugins = ["tests.support.servers.browser_fixtures"]

# What a user would type into the search, and the page with the answer.
SEARCHED = {
    "install": "install.html",
    "pipx": "install.html",
    "emergency stop": "safety.html",
    "wire": "how_to/real_arduino.html",
    "avrdude": "how_to/real_arduino.html",
    "servo twitches": "troubleshooting/index.html",
    "permission denied": "troubleshooting/index.html",
    "dialout": "how_to/real_arduino.html",
    "plan.no_path": "troubleshooting/messages.html",
    "hw.frame_lost": "troubleshooting/messages.html",
    "fingers": "how_to/own_arm.html",
    "urdf": "how_to/own_arm.html",
    "calibrate": "how_to/bus_servos.html",
    "retry": "reference/tasks.html",
    "breakpoint": "concepts/goals.html",
    "pandas": "how_to/recordings.html",
    "rosbridge": "reference/http.html",
    "moveit": "comparison.html",
    "pre-commit": "how_to/ci.html",
    "token": "reference/http.html",
    "systemd": "how_to/service.html",
    "obstacles": "how_to/plan.html",
    "quickstart": "start.html",
    "docker": "install.html",
    "autostart": "how_to/service.html",
    "uninstall": "install.html",
    "remote": "how_to/server.html",
    "inverse kinematics": "how_to/plan.html",
    "contribute": "index.html",
    "own robot": "how_to/own_arm.html",
    "licence": "index.html",
    "jupyter": "how_to/python.html",
    "simulation": "start.html",
    "keyboard": "how_to/move.html",
    "windows": "install.html",
    "upgrade": "concepts/formats.html",
    "behaviour tree": "concepts/index.html",
    "claude": "how_to/language_models.html",
    "delete recordings": "how_to/recordings.html",
    "license": "index.html",
    "aarch64": "install.html",
    "arm64": "install.html",
    "raspberry pi": "install.html",
    "joystick": "how_to/move.html",
    "gamepad": "how_to/move.html",
    "esp32": "how_to/own_driver.html",
    "pca9685": "how_to/own_driver.html",
    "ch340": "how_to/real_arduino.html",
    "password": "how_to/page.html",
    "backup": "install.html",
    "weight": "safety.html",
    "config file": "reference/settings.html",
    "arm jumps": "troubleshooting/index.html",
    "cancel": "concepts/goals.html",
    "exit status 12": "reference/exit_codes.html",
    "getting started": "start.html",
    "report a bug": "troubleshooting/index.html",
    "web interface": "how_to/page.html",
    "dry run": "how_to/plan.html",
    "plugin": "how_to/own_driver.html",
    "offline": "install.html",
    "json": "reference/output.html",
    "graph": "how_to/recordings.html",
    "vision": "comparison.html",
    "two arms": "how_to/fleet.html",
    "pick and place": "how_to/own_task.html",
    "simulator": "start.html",
    "speed": "how_to/move.html",
    "serial port": "troubleshooting/index.html",
    "error code": "troubleshooting/messages.html",
    "logging": "how_to/recordings.html",
    "csv": "how_to/recordings.html",
    "macos": "install.html",
    "vulnerability": "reference/security.html",
}

_META = "document.querySelector('.md-search-result__meta').textContent"
_ITEMS = "document.querySelectorAll('.md-search-result__item')"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site. A broken link, or a page that is not in the navigation, fails."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", "docs/mkdocs.yml"]
    done = subprocess.run(
        [*command, "-d", str(folder)],
        cwd=ROOT,
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_a_page_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 30
    loads = r'(?:src|data-src)="((?:https?:)?//[^"]+)|<link[^>]+href="((?:https?:)?//[^"]+)'
    assert {(page.name, *re.findall(loads, page.read_text())) for page in pages} == {
        (page.name,) for page in pages
    }


def test_everything_that_is_generated_is_there(site: Path) -> None:
    assert "<!-- generated" not in "".join(page.read_text() for page in site.rglob("*.html"))
    for page, words in (
        ("reference/command_line", ("armtree log prune", "--recording-timeout", "-h, --help")),
        ("reference/python", ("armtree.Arm", "Client.run", "async where(self) -&gt; Where")),
        ("reference/python", ("events(self, *kinds: str) -&gt; AbstractContextManager[",)),
        ("reference/python", ("<code>CANCELING</code> (3), <code>SUCCEEDED</code>",)),
        ("reference/skills", ("FollowLeader", "PlanArm")),
        ("reference/http", ("/api/stop",)),
        ("reference/settings", ("ARMTREE_RECORDING_TIMEOUT",)),
        ("troubleshooting/messages", ("hw.port_stalled", "Check the cable.")),
    ):
        text = (site / f"{page}.html").read_text()
        assert [word for word in words if word not in text] == []
    assert "Skill.judge" not in (site / "reference" / "python.html").read_text()  # an old name


def test_the_parts_of_a_docstring_are_paragraphs_and_lists(site: Path) -> None:
    text = (site / "reference" / "python.html").read_text()
    parts = re.findall(
        r"(.{3})<strong>(?:Args|Attributes|Raises|Returns)</strong>", text, re.DOTALL
    )
    assert len(parts) > 50
    assert set(parts) == {"<p>"}
    assert "<li><code>KeyboardInterrupt</code>: Ctrl-C was pressed. The goal has ended" in text


@pytest.fixture
def search(site: Path, browser: Any) -> Iterator[Callable[[str], list[str]]]:
    """Searches as a user does: types words, and returns the pages in the order of the results."""
    handler = partial(SimpleHTTPRequestHandler, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{server.server_port}/index.html")

        def typed(words: str) -> list[str]:
            for text, matching in (("", "!"), (words, "")):
                page.fill(".md-search__input", text)
                page.press(".md-search__input", "End")  # the page reads the field when a key is up
                page.wait_for_function(f"{matching}{_META}.includes('matching')")
            # The first results are added after the line with their number.
            page.wait_for_function(f"{_ITEMS}.length >= Math.min(3, parseInt({_META}) || 1)")
            links = page.locator(".md-search-result__item > a").evaluate_all(
                "links => links.map(link => link.pathname)"
            )
            return list(dict.fromkeys(link.removeprefix("/") for link in links))

        yield typed
        page.close()
        server.shutdown()
        thread.join()


def test_words_that_users_type_are_found(search: Callable[[str], list[str]]) -> None:
    """The page with the answer is among the first three results, mostly the first."""
    found = {words: search(words)[:3] for words in SEARCHED}
    assert {words: pages for words, pages in found.items() if SEARCHED[words] not in pages} == {}
    first = [words for words, pages in found.items() if [SEARCHED[words]] == pages[:1]]
    assert len(first) >= 0.75 * len(SEARCHED), sorted(set(SEARCHED) - set(first))
