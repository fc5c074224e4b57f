"""`armtree replay`: verify recordings, show a recorded run, or send its frames again."""

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import click

from executive.code_table import exit_status

from .settings import ABOVE_0, AT_LEAST_0, Whole, option
from .support.command_group import command, diagnostics
from .support.failures import Refusal, print_incomplete
from .support.names import RECORDING, complete_port
from .terminal.streams import echo


@command()
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True, type=RECORDING)
@click.option(
    "--verify", is_flag=True, help="Plan and compile runs again, and compare. Also takes a folder."
)
@click.option("--watch", is_flag=True, help="Show the run, without an arm.")
@click.option(
    "--on",
    "port",
    metavar="PORT",
    shell_complete=complete_port,
    help="Send the frames again: a serial port, or virtual.",
)
@click.option(
    "--speed",
    metavar="FACTOR",
    type=ABOVE_0,
    default=1.0,
    show_default=True,
    help="Factor of the speed: 2 is twice as fast. With --on: 0.01 to 1.",
)
@click.option(
    "--at",
    type=AT_LEAST_0,
    metavar="SECONDS",
    help="With --watch: show only this time [s].",
)
@click.option(
    "--jobs",
    metavar="N",
    type=Whole(1),
    help="With --verify: number of processes. Default: one per core.",
)
@option("robot", help="With --on: robot file.")
@option("recordings", "folder", help="With --on: folder for the new recording.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object per event, or per recording."
)
def replay(
    recordings: tuple[Path, ...],
    verify: bool,
    watch: bool,
    port: str | None,
    speed: float,
    at: float | None,
    jobs: int | None,
    robot: Path | None,
    folder: Path,
    as_json: bool,
) -> None:
    """Verify recorded runs, show a recorded run, or send its frames again.

    --verify plans and compiles each run again, and compares the result with the recording. --watch
    shows a run without an arm. --on PORT sends the frames of a run to an arm.

    Exit status of --verify: 12 if a recording differs. Else 10 if the end of a run is missing, even
    if the recording was recovered. Else 3 if a recording cannot be read. Else 0. Recordings that
    are being written are skipped. If there are no others, the exit status is 10.

    Keys of --watch in a terminal: space pauses, left and right move by 1 s, up and down change the
    speed, q quits.

    \b
    Examples:
      armtree replay recordings --verify
      armtree replay recordings/pick.mcap --watch --speed 2
      armtree replay recordings/pick.mcap --on virtual
    """  # noqa: D301
    if verify + watch + (port is not None) != 1:
        raise click.UsageError("give one of --verify, --watch and --on PORT")
    if verify:
        _verify(recordings, jobs, as_json)
        return
    if len(recordings) > 1:
        raise click.UsageError("--watch and --on need exactly one recording")
    if port is None:
        from .terminal.player import play

        play(recordings[0], speed, at, as_json, diagnostics().verbose)
        sys.exit(print_incomplete(recordings[0]))
    from tempfile import TemporaryDirectory

    from executive.replay.send_again import write_replay_task
    from executive.setup import Setup
    from skills.motion.query import MIN_SPEED

    from .support.run_tasks import execute

    if not MIN_SPEED <= speed <= 1:
        why = f"--on takes {MIN_SPEED:g} to 1; a higher speed would exceed the limits of the joints"
        raise click.UsageError(f"--speed {speed:g}: {why}")
    with TemporaryDirectory() as trees:
        setup = Setup(
            port=port,
            robot=robot,
            trees=Path(trees),
            reload=False,
            recordings=folder,
            single_user=True,
        )
        task = write_replay_task(recordings[0], speed, setup.load_robot(), Path(trees))
        outcomes = execute(
            setup, [task], as_json=as_json, known=False, verbose=diagnostics().verbose
        )
    sys.exit(exit_status(outcomes[-1].code))


def _verify(given: Iterable[Path], jobs: int | None, as_json: bool) -> None:
    from executive.errors import ReplayDiffers
    from executive.replay.verification import verify_all
    from logs import RecordingInUse

    paths = [path for each in given for path in files_of(each)]
    wrong: list[tuple[Path, str]] = []
    written = 0
    for verification in verify_all(paths, jobs or os.cpu_count() or 1):
        echo(verification.json() if as_json else verification.text())
        same = all(check.holds for check in verification.checks)
        if verification.code == RecordingInUse.code:
            written += 1
        elif code := verification.code if same else ReplayDiffers.code:
            wrong.append((verification.path, code))
    if not as_json and len(paths) > 1:
        _sum_up(len(paths) - written, written, wrong)
    if written == len(paths):
        sys.exit(RecordingInUse.exit_status)
    # The most severe status counts: differs, then incomplete, then unreadable.
    sys.exit(max((exit_status(code) for _, code in wrong), default=0))


def _sum_up(verified: int, written: int, wrong: Sequence[tuple[Path, str]]) -> None:
    skipped = f", {written} still being written" if written else ""
    held = f"{verified - len(wrong)} of {verified} recordings are verified{skipped}"
    echo(f"{held}{'; the others:' if wrong else ''}")
    for path, code in wrong:
        echo(f"  {path}  {code}")


def files_of(path: Path) -> list[Path]:
    """Return a recording, or all recordings of a folder.

    Raises:
        Refusal: The folder has no recordings.
    """
    if not path.is_dir():
        return [path]
    if found := sorted(path.glob("*.mcap")):
        return found
    raise Refusal(f"{path}: there are no recordings in this folder")
