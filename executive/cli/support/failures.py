"""Prints errors on the terminal. The exit status of an error is the `exit_status` of its class."""

import errno
import json
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli.terminal.streams import echo
from executive.code_table import exit_status
from hardware import ArmtreeError, InternalError, host_limit
from hardware.spelling import closest, did_you_mean

if TYPE_CHECKING:
    from executive.api.outcome import Cause
    from trees import Mistake


_QUOTE = "'"
_NEAR = 0.71  # smallest similarity to suggest an option


class Refusal(click.ClickException):
    """A correct command that cannot be executed in this situation."""

    exit_code = 2  # the exit status of `UsageError`, whose code is printed


def print_error(error: Exception) -> int:
    """Print an error with its code and hint to standard error. Return the exit status.

    If the command line has --json, also print the error as JSON to standard output. The definition
    `error` of `docs/output.schema.json` describes the JSON object.
    """
    from executive.api.outcome import cause_of
    from executive.errors import FileUnusable, UsageError

    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        error.show()
        return error.exit_code
    if isinstance(error, click.ClickException):
        words = _usage_words(error)
        shown = f"{words} [{UsageError.code}]".replace("\n", "\n  ")
        echo(f"Error: {shown}", err=True)
        return _print_json(cause_of(UsageError(words)), error)
    known = error
    if limit := host_limit(error):
        known = limit
    elif isinstance(error, FileNotFoundError) and not error.filename:  # raised by os.getcwd()
        known = FileUnusable("the working folder was deleted; change to another folder")
    elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
        file = f"{error.filename}: " if error.filename else ""
        known = FileUnusable(f"{file}the disk is full; delete files, then try again")
    elif isinstance(error, OSError) and error.filename:
        known = FileUnusable(f"{error.filename}: {error.strerror}; check the path")
    elif not isinstance(error, ArmtreeError):
        known = InternalError(f"{error!r}; --debug prints the traceback")
    cause = cause_of(known)
    words = cause.message if isinstance(known, InternalError) else str(known)
    hint = vars(error).get("hint")  # an error that a server returned
    more = f"\n  -> {hint}" if hint and hint.lower() not in words.lower() else ""
    lines = f"{words} [{cause.code}]".replace("\n", "\n  ")
    echo(f"Error: {lines}{more}", err=True)
    return _print_json(cause, error)


def _usage_words(error: click.ClickException) -> str:
    """Return the message for a wrong command line, with its right form or the command for help."""
    words = error.format_message().replace("\n\t", " ").rstrip(".")
    if isinstance(error, click.NoSuchOption):
        words = error.message.rstrip(".") + _instead_of(error)
    elif isinstance(error, click.BadParameter) and error.param and error.message:
        words = f"{error.param.get_error_hint(error.ctx).replace(_QUOTE, '')}: {error.message}"
    if not isinstance(error, click.UsageError) or error.ctx is None or words.endswith("?"):
        return words
    context, argument = error.ctx, isinstance(getattr(error, "param", None), click.Argument)
    if (argument and "write" not in words) or words.startswith("Got unexpected"):
        _, *pieces = context.command.collect_usage_pieces(context)
        words += f"; write {' '.join([context.command_path, *pieces])}"
    return f"{words}; see {context.command_path} --help"


def _instead_of(error: click.NoSuchOption) -> str:
    """Return what to write instead of an unknown option; empty if that is unclear."""
    known = error.ctx.command.params if error.ctx else []
    names = [name for each in known for name in each.opts]
    if near := closest(error.option_name, [name for name in names if name[:1] == "-"], _NEAR):
        return did_you_mean(near)
    name = error.option_name.lstrip("-").replace("-", "_")
    if "--set" in names:
        return f"; for a parameter of the task write --set {name}=VALUE"
    if {"target", "goal"} & {*names}:
        return f"; for a joint write {name}=VALUE, without dashes"
    return ""


def _print_json(cause: "Cause", error: Exception) -> int:
    """Print a cause if the command line has --json. Return its exit status."""
    status = exit_status(cause.code)
    if "--json" in sys.argv:
        places = [plain_mistake(each) for each in getattr(error, "mistakes", ())]
        words = {"code": cause.code, "message": cause.message, "hint": cause.hint}
        more = {"exit_status": status, "places": places, "cause": cause.to_json()}
        with suppress(OSError):  # the disk of the output may be full, which is then the cause
            echo(json.dumps({"event": "error", **words, **more}))
    return status


def plain_mistake(mistake: "Mistake") -> dict[str, Any]:
    """Return a mistake in a file as a JSON object."""
    return {
        "file": str(mistake.place.path),
        "line": mistake.place.line,
        "column": mistake.place.column,
        "path": mistake.place.location,
        "message": mistake.message,
        "instead": mistake.instead.text if mistake.instead else "",
        "instead_line": mistake.instead.line if mistake.instead else 0,
        "instead_count": mistake.instead.count if mistake.instead else 0,
    }


def for_each(recordings: Iterable[Path], act: Callable[[Path], int]) -> int:
    """Call a function with each recording. Return the highest exit status.

    An error of one recording is printed. The other recordings are not affected.
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
    """Print an error for each recording without the end of its run. Return the exit status.

    Raises:
        RecordingError: A recording cannot be read.
    """
    from executive.api.outcome import cause_of
    from logs import Recording
    from logs.reading.file_state import why_incomplete

    found = (why_incomplete(Recording(recording)) for recording in recordings)
    reasons = [reason for reason in found if reason]
    for reason in reasons:
        echo(reason, err=True)
        _print_json(cause_of(reason), reason)
    return max((reason.exit_status for reason in reasons), default=0)
