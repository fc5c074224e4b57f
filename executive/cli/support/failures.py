"""Errors on the terminal, and the exit status that follows from them."""

import errno
from collections.abc import Callable, Iterable
from pathlib import Path

from executive.api.codes import INTERNAL, look_up
from executive.cli.terminal.streams import echo


def print_error(error: Exception) -> int:
    """Print an error with its code and hint. Return the exit status."""
    code, words = getattr(error, "code", INTERNAL), str(error)
    if isinstance(error, OSError) and error.filename:
        code, words = "file", f"{error.filename}: {error.strerror}; check the path"
    elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
        code, words = "file", "the disk is full; make room, then try again"
    elif code == INTERNAL:
        words = f"a bug in armtree: {error!r}; --debug shows where"
    hint = vars(error).get("hint")  # an error that a server returned
    more = f"\n  -> {hint}" if hint and hint not in words else ""
    lines = f"{words} [{code}]".replace("\n", "\n  ")
    echo(f"Error: {lines}{more}", err=True)
    return look_up(code).exit_status


def for_each(recordings: Iterable[Path], act: Callable[[Path], int]) -> int:
    """Call a function with each recording. Return the highest exit status.

    An error of one recording is printed, and does not affect the others.
    """
    from logs import LogError

    status = 0
    for recording in recordings:
        try:
            status = max(status, act(recording))
        except (LogError, OSError) as error:
            status = max(status, print_error(error))
    return status


def print_incomplete(*recordings: Path) -> int:
    """Print which recordings lack the end of their run. Return the exit status.

    Raises:
        RecordingError: A recording cannot be read.
    """
    from logs import Recording
    from logs.reading.file_state import why_incomplete

    reasons = [why_incomplete(Recording(recording)) for recording in recordings]
    for reason in filter(None, reasons):
        echo(reason, err=True)
    return max((reason.exit_status for reason in reasons if reason), default=0)
