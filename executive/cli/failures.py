"""What went wrong, told to who typed a command."""

import errno
from collections.abc import Callable, Iterable
from pathlib import Path

import click

from executive.codes import INTERNAL, look_up


def tell(error: Exception) -> int:
    """Print what went wrong, with its code and hint; gives the exit status that says so."""
    code, words = getattr(error, "code", INTERNAL), str(error)
    if isinstance(error, OSError) and error.filename:
        code, words = "file", f"{error.filename}: {error.strerror}; check the path"
    elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
        code, words = "file", "the disk is full; make room, then try again"
    elif code == INTERNAL:
        words = f"a bug of ours: {error!r}; see --debug"
    hint = vars(error).get("hint")  # of what a server refused
    more = f"\n  -> {hint}" if hint and hint not in words else ""
    click.echo(f"Error: {words} [{code}]{more}", err=True)
    return look_up(code).exit_status


def with_each(recordings: Iterable[Path], act: Callable[[Path], int]) -> int:
    """Do something with every recording, whatever is wrong with others; the worst exit status."""
    from logs import LogError

    status = 0
    for recording in recordings:
        try:
            status = max(status, act(recording))
        except (LogError, OSError) as error:
            status = max(status, tell(error))
    return status
