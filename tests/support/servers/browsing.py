"""What tests of the page share."""

import re
from collections.abc import Callable
from typing import Any

Tab = Any  # a page of playwright, whose interface takes mypy long to read
Open = Callable[..., Tab]


def shows(tab: Tab, selector: str, words: str) -> None:
    """Wait until an element shows a text."""
    tab.locator(selector, has_text=re.compile(words)).first.wait_for()


def forget(tab: Tab, words: str) -> None:
    """Ignore the errors with these words, which the test has provoked."""
    tab.problems[:] = [each for each in tab.problems if words not in each]
