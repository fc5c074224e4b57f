"""`armtree replay`: a recording proved, watched, or sent once more."""

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from executive.codes import DIFFERS, look_up

from .incomplete import incomplete
from .options import ABOVE_0, AT_LEAST_0, PATH


@click.command()
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True, type=PATH)
@click.option("--verify", is_flag=True, help="Compile and plan it again; folders may be given too.")
@click.option("--watch", is_flag=True, help="Show it as it was shown, without an arm.")
@click.option("--on", "port", metavar="PORT", help="Send its frames again: a port, or virtual.")
@click.option("--speed", type=ABOVE_0, default=1.0, show_default=True)
@click.option(
    "--at", type=AT_LEAST_0, metavar="SECONDS", help="With --watch: show this moment only."
)
@click.option(
    "--jobs", type=click.IntRange(1), help="With --verify: processes; default: all cores."
)
@click.option("--robot", type=PATH, envvar="ARMTREE_ROBOT", help="With --on: robot file.")
@click.option(
    "--recordings",
    "folder",
    type=PATH,
    envvar="ARMTREE_RECORDINGS",
    default=Path("recordings"),
    show_default=True,
    help="With --on: folder for the recording of the replay.",
)
@click.option("--json", is_flag=True, help="Print one JSON object per event, or per recording.")
def replay(recordings: tuple[Path, ...], **options: Any) -> None:
    """Prove a recording (--verify), watch it (--watch), or send its frames again (--on PORT).

    Exit status of --verify: 0 if all is the same in all of them, 12 where one differs, else 10
    where one lacks its end, 3 where one cannot be read; one that is being written is passed over,
    and 10 if there is no other. While watching in a terminal: space pauses,
    left and right go back and forth by 1 s, up and down change the speed, q quits.
    """
    chosen = [bool(options["verify"]), bool(options["watch"]), options["port"] is not None]
    if sum(chosen) != 1:
        raise click.UsageError("give one of --verify, --watch and --on PORT")
    if options["verify"]:
        _verify(recordings, options["jobs"], options["json"])
        return
    if len(recordings) > 1:
        raise click.UsageError("--watch and --on go with one recording")
    if options["watch"]:
        from .watching import watch

        watch(recordings[0], options["speed"], options["at"], _view(options["json"]))
        sys.exit(incomplete(recordings[0]))
    _send(recordings[0], **options)


def _verify(given: Iterable[Path], jobs: int | None, as_json: bool) -> None:
    from executive.replay.verification import verify_all
    from logs import RecordingInUse

    paths = [path for each in given for path in files_of(each)]
    wrong: list[tuple[Path, str]] = []
    written = 0
    for verification in verify_all(paths, jobs or os.cpu_count() or 1):
        click.echo(verification.json() if as_json else verification.text())
        same = all(check.holds for check in verification.checks)
        if verification.code == RecordingInUse.code:
            written += 1
        elif code := verification.code if same else DIFFERS:
            wrong.append((verification.path, code))
    if not as_json and len(paths) > 1:
        _sum_up(len(paths) - written, written, wrong)
    if written == len(paths):
        sys.exit(RecordingInUse.exit_status)
    # The highest status counts: differs, then incomplete, then unreadable.
    sys.exit(max((look_up(code).exit_status for _, code in wrong), default=0))


def _sum_up(judged: int, written: int, wrong: Sequence[tuple[Path, str]]) -> None:
    passed = f", {written} still being written" if written else ""
    held = f"{judged - len(wrong)} of {judged} recordings hold{passed}"
    click.echo(f"{held}{'; not:' if wrong else ''}")
    for path, code in wrong:
        click.echo(f"  {path}  {code}")


def files_of(path: Path) -> list[Path]:
    """A recording, or all recordings of a folder.

    Raises:
        click.UsageError: The folder has none.
    """
    if not path.is_dir():
        return [path]
    if found := sorted(path.glob("*.mcap")):
        return found
    raise click.UsageError(f"{path}: there are no recordings here")


def _view(as_json: bool) -> Any:
    from .display import view_for

    verbose = click.get_current_context().find_root().params["verbose"]
    return view_for(as_json, verbose)


def _send(recording: Path, **options: Any) -> None:
    from executive.setup import Setup

    from .sending import send

    if options["speed"] > 1:
        what = "the motion was timed to the limits of the joints; at most 1, or faster with --watch"
        raise click.UsageError(f"--speed {options['speed']:g}: {what}")
    verbose = click.get_current_context().find_root().params["verbose"]
    setup = Setup(
        port=options["port"],
        robot=options["robot"],
        recordings=options["folder"],
        single_user=True,
    )
    outcomes = send(recording, options["speed"], setup, options["json"], verbose)
    sys.exit(look_up(outcomes[-1].code).exit_status)
