"""`armtree log`: list, show, export, compare, draw, recover and delete recordings."""

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .settings import AT_LEAST_0, find_setting
from .support.command_group import CommandGroup
from .support.failures import for_each, print_incomplete
from .support.names import RECORDING, recordings_folder
from .support.options import drawing_option
from .terminal.streams import echo, echo_result

if TYPE_CHECKING:
    from hardware import Joint
    from logs.views.narrative import Overview
    from logs.views.run_figure import MotionScene

_TITLE = 24  # columns of a title in a list

_FILE = click.argument("recording", type=RECORDING)
_FILES = click.argument(
    "recordings", metavar="RECORDING...", nargs=-1, required=True, type=RECORDING
)
_OUTPUT = click.option(
    "-o",
    "--output",
    metavar="FOLDER",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path(),
    help="Folder for the files, created if it does not exist. Default: the working directory.",
)


_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON: an object per line.")


def _file(path: Path) -> dict[str, str]:
    return {"file": str(path)}


@click.group(cls=CommandGroup)
def log() -> None:
    """List, show, compare, draw, recover and delete recordings."""


@log.command()
@click.argument(
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    default=lambda: recordings_folder(click.get_current_context()),
)
@_JSON
def ls(folder: Path, as_json: bool) -> None:
    """List the recordings of FOLDER, with task, outcome, duration and size.

    The default of FOLDER is the setting `recordings`, which is ./recordings by default. If that
    folder does not exist, it is the working directory if it has recordings. With `serve --policy
    queue`, a goal waits in the queue until the previous goals have ended; the duration includes
    this time. The list is read from the index of each recording. `log info` reads the whole file,
    and finds any damage. A recording that a crash cut off is marked `recovered` after its recovery.
    """
    from logs import LogError, goal_title
    from logs.views.narrative import listing
    from logs.writing.retention import pinned

    paths = _recordings_in(folder)
    width = max((len(path.name) for path in paths), default=0) + 2
    for path in paths:
        try:
            found = listing(path)
        except (LogError, OSError) as error:
            row = {**_file(path), "unreadable": str(error)}
            echo_result(as_json, row, f"{path.name}  unreadable: {error}")
            continue
        end = "being written" if found.written else "UNFINISHED"
        end = ("recovered" if found.recovered else "") if found.complete else end
        queued = f"waited {found.waited:.2f} s in the queue" if found.waited else ""
        marks = ("pinned" if pinned(path) else "", end, queued)
        task = goal_title(found.goal.task, found.goal.name) if found.goal else "-"
        task = task.removeprefix("task ")
        task = task if len(task) <= _TITLE else f"{task[: _TITLE - 1]}…"
        spent = f"{found.result.duration:.2f} s" if found.result else "-"
        frames = f"{found.frames:>6} {'frame' if found.frames == 1 else 'frames'}"
        line = f"{path.name:<{width}}{task:<{_TITLE}} {found.outcome:<11}{spent:>9}{frames:<13}"
        line = f"{line}{found.bytes / 1e3:>9.1f} kB  {' '.join(filter(None, marks))}".rstrip()
        echo_result(as_json, {**found.to_json(), "pinned": pinned(path)}, line)


def _recordings_in(folder: Path) -> list[Path]:
    paths = sorted(folder.glob("*.mcap"))
    if not paths:
        echo(f"{folder.absolute()}: there are no recordings in this folder", err=True)
    return paths


@log.command()
@_FILE
@_JSON
def info(recording: Path, as_json: bool) -> None:
    """Summarise a recording: task, outcome, timing, files and versions."""
    from logs import RecordingTruncated
    from logs.views.narrative import overview

    found = overview(recording)
    lines = (f"{name:<12}{value}" for name, value in _facts(found))
    echo_result(as_json, found.to_json(), *lines)
    whole = found.complete and not found.recovered
    sys.exit(0 if whole else RecordingTruncated.exit_status)


def _facts(found: "Overview") -> list[tuple[str, str]]:
    from statistics import median_low

    from logs import goal_title
    from logs.records.file_format import RECOVERED

    end = f"cut off or damaged; type: armtree log recover {found.path}"
    end = "complete" if found.complete else end
    end = "being written" if found.written else end
    facts = [("file", f"{found.path}, {found.bytes} bytes, {found.messages} messages, {end}")]
    if torn := found.notes.get(RECOVERED, {}).get("torn_bytes"):
        bytes_ = f" {torn} bytes were damaged" if torn != "0" else ""
        facts.append(("recovered", f"the file was cut off or damaged;{bytes_}".rstrip(";")))
    if goal := found.goal:
        facts.append(("goal", f"{goal_title(goal.task, goal.name)}, seed {goal.seed}"))
    facts.append(("outcome", found.outcome))
    if result := found.result:
        facts.append(("cause", f"{result.code}: {result.message}"))
        queued = f", {found.waited:.3f} s of it in the queue" if found.waited else ""
        facts.append(("duration", f"{result.duration:.3f} s{queued}"))
    facts.append(("frames", f"{found.frames}, {found.holds} of them hold the arm"))
    if late := found.late:
        middle = median_low(late.elements())
        facts.append(("lateness", f"{middle:.2f} ms median, {max(late):.2f} ms at most"))
    for group, spent in found.planning.items():
        facts.append(("planning", f"{group} {spent:.1f} ms"))
    facts.append(("attached", ", ".join(found.files) or "nothing"))
    for what, note in (("configured", "configuration"), ("versions", "versions")):
        noted = found.notes.get(note, {})
        facts.append((what, ", ".join(f"{name} {is_}" for name, is_ in noted.items()) or "-"))
    return facts


@log.command()
@_FILE
@click.option(
    "--all", "everything", is_flag=True, help="Include all frames, received bytes and measurements."
)
@_JSON
def show(recording: Path, everything: bool, as_json: bool) -> None:
    """Print what happened in a run. Times are in seconds since the goal was accepted."""
    from logs.views.narrative import narrative

    for time, words in narrative(recording, everything):
        echo_result(as_json, {"time_s": time, "text": words}, f"{time:+10.3f}  {words}")
    sys.exit(print_incomplete(recording))


@log.command()
@_FILE
@_OUTPUT
@_JSON
def export(recording: Path, output: Path, as_json: bool) -> None:
    """Write the joint positions and the frames to CSV files.

    RECORDING.joints.csv has the commanded positions, RECORDING.frames.csv the frames. If the board
    measures, RECORDING.measured.csv has the measured positions. If the arm followed a leader,
    RECORDING.leader.csv has the measured positions of the leader.
    """
    from logs.views.table import export as write

    for path in write(recording, output):
        echo_result(as_json, _file(path), path)
    sys.exit(print_incomplete(recording))


@log.command()
@_FILE
@_OUTPUT
@_JSON
def robot(recording: Path, output: Path, as_json: bool) -> None:
    """Write the recorded robot file, URDF and meshes, for viewers and for other commands."""
    from executive.recording.archive import extract_robot
    from logs import Recording

    for path in extract_robot(Recording(recording), output):
        echo_result(as_json, _file(path), path)


@log.command()
@click.argument("one", type=RECORDING)
@click.argument("other", type=RECORDING)
@drawing_option()
@_JSON
def diff(one: Path, other: Path, output: Path | None, as_json: bool) -> None:
    """Compare the frames and joint positions of two runs.

    The exit status is 12 if the frames differ.
    """
    from executive.errors import ReplayDiffers
    from executive.recording.archive import restore_robot
    from logs import Recording, RecordingError
    from logs.views.comparison import compare

    both, known = compare(one, other), dict[str, "Joint"]()
    with suppress(RecordingError):  # a recording of another program has no robot
        known = {joint.name: joint for joint in restore_robot(Recording(one)).joints}
    lines = [both.first or f"all {len(both.runs[0].frames)} frames are the same"]
    if all(run.joints for run in both.runs) and not both.joints:
        arms = (", ".join(run.joints) for run in both.runs)
        lines.append(f"two arms without a common joint: {' | '.join(arms)}")
    joints = {}
    for joint, (distance, time) in both.joints.items():
        words = known[joint].words(distance) if joint in known else f"{distance:.4f} rad"
        lines.append(f"{joint:<12}differs by at most {words}, at {time:.3f} s")
        joints[joint] = {"distance": distance, "time_s": time}
    if output:
        from logs.views.comparison_figure import draw_comparison

        draw_comparison(both, output)
        lines.append(str(output))
    drawing = str(output) if output else None
    row = {"same": not both.first, "first": both.first, "joints": joints, "drawing": drawing}
    echo_result(as_json, row, *lines)
    partial = print_incomplete(one, other)
    sys.exit(ReplayDiffers.exit_status if both.first else partial)


@log.command()
@_FILES
@drawing_option("Default: a PNG beside the recording.")
@_JSON
def plot(recordings: tuple[Path, ...], output: Path | None, as_json: bool) -> None:
    """Draw joint positions, timing and scenes of recordings."""
    from logs import plot as draw

    if output and len(recordings) > 1:
        raise click.UsageError("--output needs exactly one recording")

    def drawn(recording: Path) -> int:
        status = print_incomplete(recording)
        target = output or recording.with_suffix(".png")
        scenes, why = _scenes(recording)
        draw(recording, target, scenes)
        if why:
            echo(f"{recording}: the bodies around the arm are not drawn: {why}", err=True)
        echo_result(as_json, _file(target), target)
        return status

    sys.exit(for_each(recordings, drawn))


def _scenes(recording: Path) -> "tuple[list[MotionScene], str]":
    """Return the scenes of a recording and "", or no scenes and the error."""
    from executive.preview.motion_drawing import scenes_of
    from logs import LogError
    from skills.motion import BadWorld

    try:
        return scenes_of(recording), ""
    except (LogError, BadWorld, OSError) as error:
        return [], str(error)


@log.command()
@_FILES
@_JSON
def recover(recordings: tuple[Path, ...], as_json: bool) -> None:
    """Recover recordings that a crash has cut off.

    The exit status is 10 if something was lost.
    """
    from logs import RecordingIncomplete, recover as recover_file

    def recover_one(recording: Path) -> int:
        made = recover_file(recording)
        row = {**_file(recording), "recovered": made is not None, "whole": not made or made.whole}
        text = made.text() if made else f"{recording} is complete; nothing to recover"
        echo_result(as_json, row, text)
        return 0 if made is None or made.whole else RecordingIncomplete.exit_status

    sys.exit(for_each(recordings, recover_one))


@log.command()
@_FILES
@click.option("--off", is_flag=True, help="Unpin: prune may delete the recordings again.")
@_JSON
def pin(recordings: tuple[Path, ...], off: bool, as_json: bool) -> None:
    """Pin recordings: prune never deletes them. A pinned file is write-protected."""
    from logs.writing.retention import pin as pin_file

    def pin_one(recording: Path) -> int:
        pin_file(recording, not off)
        text = f"{recording}: {'not pinned' if off else 'pinned'}"
        echo_result(as_json, {**_file(recording), "pinned": not off}, text)
        return 0

    sys.exit(for_each(recordings, pin_one))


@log.command()
@click.argument(
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    default=lambda: find_setting(click.get_current_context(), "recordings")[0],
)
@click.option(
    "--days", metavar="DAYS", type=AT_LEAST_0, help="Delete recordings older than this [days]."
)
@click.option(
    "--mb", metavar="MB", type=AT_LEAST_0, help="Delete the oldest to keep at most this size [MB]."
)
@click.option("--dry-run", is_flag=True, help="Delete nothing; list what would be deleted.")
@_JSON
def prune(folder: Path, days: float | None, mb: float | None, dry_run: bool, as_json: bool) -> None:
    """Delete old recordings of FOLDER, but never a pinned or an unfinished one.

    Pictures in FOLDER with the name of a deleted recording are deleted too.

    The default of FOLDER is the setting `recordings`, which is ./recordings by default. Without
    --days and --mb, the settings `keep_days` and `keep_mb` decide what is deleted.

    \b
    Example:
      armtree log prune --days 30 --mb 500 --dry-run
    """  # noqa: D301
    from hardware import RealClock, utc_ns
    from logs.writing.retention import Rule, prune as delete_old

    if days is None and mb is None:
        context = click.get_current_context()
        days, mb = (find_setting(context, name)[0] for name in ("keep_days", "keep_mb"))
    if days is None and mb is None:
        raise click.UsageError("give --days, --mb or both; or set keep_days or keep_mb")
    _recordings_in(folder)  # warns of a misspelt folder
    clock = RealClock()
    utc = utc_ns(clock) / 1e9
    for path in delete_old(folder, Rule(days, mb), utc, dry_run):
        text = f"{path}: {'would be deleted' if dry_run else 'deleted'}"
        echo_result(as_json, {**_file(path), "deleted": not dry_run}, text)
