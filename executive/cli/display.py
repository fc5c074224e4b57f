"""Which view shows a run: a live picture, plain lines, or JSON."""

import sys

from .view import JsonView, TextView, View


def view_for(as_json: bool, verbose: bool) -> View:
    """Return what shows a run in this terminal or pipe.

    Args:
        as_json: True to print JSON.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.
    """
    if as_json:
        return JsonView()
    if verbose or not sys.stdout.isatty():
        return TextView()
    from rich.console import Console

    from .live_view import LiveView

    return LiveView(Console())
