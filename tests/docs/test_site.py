"""The documentation site builds without a warning, loads nothing from elsewhere, and is found."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT

# What a user would type into the search, and the page with the answer.
SEARCHED = {
    "install": "install.html",
    "pipx": "install.html",
    "emergency stop": "safety.html",
    "wire": "how_to/real_arduino.html",
    "avrdude": "how_to/real_arduino.html",
    "twitches": "troubleshooting/index.html",
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
    "rosbridge": "how_to/ros2.html",
    "moveit": "comparison.html",
    "pre-commit": "how_to/ci.html",
    "token": "reference/http.html",
    "systemd": "how_to/service.html",
    "obstacles": "how_to/plan.html",
    "licence": "reference/licence.html",
}

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
        ("reference/command_line", ("armtree log prune", "--recording-timeout")),
        ("reference/python", ("armtree.Arm", "armtree.Client", "Client.run")),
        ("reference/skills", ("FollowLeader", "PlanArm")),
        ("reference/http", ("/api/stop",)),
        ("reference/settings", ("ARMTREE_RECORDING_TIMEOUT",)),
        ("troubleshooting/messages", ("hw.port_stalled", "Check the cable.")),
    ):
        text = (site / f"{page}.html").read_text()
        assert [word for word in words if word not in text] == []


def test_words_that_users_type_are_found(site: Path) -> None:
    index = json.loads((site / "search" / "search_index.json").read_text())["docs"]
    pages = dict.fromkeys((row["location"].partition("#")[0] for row in index), "")
    for row in index:
        pages[row["location"].partition("#")[0]] += f" {row['title']} {row['text']}".lower()
    assert {word: page for word, page in SEARCHED.items() if word not in pages[page]} == {}
