"""The exit status of commands that read recordings, which may lack their end."""

from pathlib import Path

import click

from executive.codes import look_up


def incomplete(*recordings: Path) -> int:
    """Tell which recordings were read in part only; gives the exit status that says so.

    Raises:
        RecordingError: One of them cannot be read.
    """
    from logs import Recording
    from logs.reading.file_state import why_incomplete

    told = [words for recording in recordings if (words := why_incomplete(Recording(recording)))]
    for words in told:
        click.echo(words, err=True)
    return look_up("log.truncated").exit_status if told else 0
