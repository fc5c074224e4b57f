"""What tests of the page share."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from tests.support.paths import ROOT

Tab = Any  # a page of playwright, whose interface takes mypy long to read
Open = Callable[..., Tab]


def shows(tab: Tab, selector: str, words: str) -> None:
    """Wait until an element shows a text."""
    tab.locator(selector, has_text=re.compile(words)).first.wait_for()


def expect(tab: Tab, selector: str) -> Any:
    """The assertions of playwright about an element, which wait until they hold."""
    from playwright.sync_api import expect as expected

    expected.set_options(timeout=20_000)  # also on a busy machine
    return expected(tab.locator(selector))


def until(tab: Tab, holds: Callable[[], object]) -> None:
    """Wait until something holds for this test, such as that a request has arrived."""
    for _ in range(1000):  # 20 s, as above
        if holds():
            return
        tab.wait_for_timeout(20)
    raise AssertionError("what the test waits for has not come within 20 s")


def is_accessible(tab: Tab) -> None:
    """Check the connected page with axe-core, if `make lint` has installed it."""
    axe = ROOT / "executive/server/page/node_modules/axe-core/axe.min.js"
    if not axe.is_file():
        pytest.skip("axe-core is not installed")
    tab.wait_for_selector("body:not(.lost)")  # until then it is grey
    tab.evaluate(axe.read_text())
    found = tab.evaluate("axe.run()")["violations"]
    violations = {each["id"]: [node["html"] for node in each["nodes"]] for each in found}
    assert not violations, violations  # this module's assertions are not rewritten by pytest


def forget(tab: Tab, words: str) -> None:
    """Ignore the errors with these words, which the test has provoked."""
    tab.problems[:] = [each for each in tab.problems if words not in each]
