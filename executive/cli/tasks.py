"""`armtree tasks`, `check`, `show`, `new`, `skills` and `schema`: commands for task files."""

import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hardware import DISPLAY_UNITS, write_file
from hardware.printable import escaped, plural

from .settings import PATH, Whole, given_options, option
from .support.command_group import command
from .support.failures import plain_mistake, print_incomplete
from .support.names import TASK_OR_RECORDING, load_library
from .support.options import (
    own_trees_option,
    recordings_option,
    robot_option,
    skills_option,
    trees_option,
)
from .terminal.streams import echo, fit

if TYPE_CHECKING:
    from hardware import Robot
    from trees import Declaration

_MOST_NAMED = 3  # largest number of files in the last line of `armtree check`
_MOST_RECORDINGS = 200  # largest number of recordings that `armtree tasks` opens, to be quick

_output_option = click.option(
    "-o", "--output", metavar="FILE", type=PATH, help="File to write. Default: standard output."
)


@command()
@trees_option
@robot_option
@recordings_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per task.")
def tasks(trees: Path | None, robot: Path | None, recordings: Path, as_json: bool) -> None:
    """List the tasks of a robot, their parameters and their last outcomes."""
    from trees import FileError

    loaded, library = load_library(trees, robot)
    mistakes = list(library.mistakes)
    outcomes = _last_outcomes(recordings, loaded, library.names())
    for number in library.numbers():
        try:
            task = library.head(number)
        except FileError as error:
            mistakes += error.mistakes
            if not as_json:
                echo(f"{number:>4}  has mistakes", err=True)
            continue
        row = {
            "task": number,
            "name": task.name,
            "description": task.description,
            "source": "shipped" if task.path.parent in library.shipped else str(task.path),
            "parameters": {name: _declared(p) for name, p in task.parameters.items()},
            "last_outcome": outcomes.get(number, ""),
        }
        echo(json.dumps(row) if as_json else _task_lines(row))
    if not library.numbers():
        echo(f"no task is for {library.robot}; `armtree new 0 NAME` writes a task", err=True)
    if mistakes:
        raise FileError(mistakes)


def _task_lines(row: dict[str, Any]) -> str:
    lines = [f"{row['task']:>4}  {row['name']:<12} {row['description']}"]
    details = [row["source"]]
    details += [f"--set {name}={declared}" for name, declared in row["parameters"].items()]
    details += [f"last: {row['last_outcome']}"] if row["last_outcome"] else []
    return "\n".join([*lines, *(f"{'':<19}{line}" for line in details)])


def _declared(declared: "Declaration") -> str:
    """Return the type, limits and default of a parameter."""
    default = declared.default
    text = default is not None and isinstance(default.value, str)
    value = "" if default is None else f" {default.value if text else default}"
    limits = ""
    if declared.least is not None or declared.most is not None:
        scale, unit = DISPLAY_UNITS.get(declared.unit, (1.0, declared.unit))
        least = "" if declared.least is None else f"{scale * declared.least:g}"
        most = "" if declared.most is None else f"{scale * declared.most:g}"
        limits = f", {least}..{most}{' ' + unit if unit else ''}"
    choices = f", {'|'.join(declared.choices)}" if declared.choices else ""
    return f"{declared.type.upper()}{limits}{choices}" + (f" (default{value})" if value else "")


def _last_outcomes(folder: Path, robot: "Robot", names: Mapping[str, int]) -> dict[int, str]:
    """Return the outcome of the last recorded run of each task of a robot, by task number."""
    from logs.reading.find import runs

    tasks = {number: name for name, number in names.items()}
    outcomes, opened = dict[int, str](), 0
    for time, number, path in runs(folder):
        if number not in tasks or number in outcomes:
            continue
        if opened == _MOST_RECORDINGS:
            break
        opened += 1
        if outcome := _outcome(time, path, robot, tasks[number]):
            outcomes[number] = outcome
    return outcomes


def _outcome(time: str, path: Path, robot: "Robot", name: str) -> str:
    """Return the outcome of a run; empty if it was of another robot or of a task of another name.

    Robots are the same if their files have the same name.
    """
    from logs import Goal, LogError, Result
    from logs.reading.indexed import IndexedRecording

    when = f"{time[:4]}-{time[4:6]}-{time[6:8]} {time[9:11]}:{time[11:13]} UTC"
    try:
        recording = IndexedRecording(path)
        goal, result = recording.record_at(0, Goal), recording.record_at(-1, Result)
        own = robot.path.name
        same_robot = recording.notes.get("robot", {}).get("file", own) == own
    except LogError:
        goal = result = None
        same_robot = True
    if not same_robot or (goal and goal.name != name):
        return ""
    return f"{result.state} {when}" if result else f"unknown, {path.name} is not complete"


@command()
@click.argument("files", metavar="[FILE]...", nargs=-1, type=PATH)
@trees_option
@skills_option
@robot_option
@option("world")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(
    files: Sequence[Path],
    trees: Path | None,
    robot: Path | None,
    world: Path | None,
    as_json: bool,
) -> None:
    """Check task files and report every mistake with its line. Nothing moves.

    Without FILE, checks all files of --trees. A FILE is checked together with the other files of
    its folder. If FILE is a folder, all its files are checked. The exit status is 3 if there is a
    mistake.
    """
    source = click.get_current_context().get_parameter_source("trees")
    if files and source is click.core.ParameterSource.COMMANDLINE:
        raise click.UsageError(
            "give --trees or FILE, not both: a FILE is checked with the other files of its folder"
        )
    from executive.preview.world_file import check_world, read_world
    from hardware import load_robot
    from skills.motion import EMPTY
    from trees import FileError
    from trees.check import check as find_mistakes

    loaded, bodies = load_robot(robot), EMPTY
    if world:
        bodies = read_world(world)
        check_world(world, bodies, loaded)
    findings = find_mistakes(loaded, trees, files, bodies)
    for note in findings.notes:
        echo(f"note: {note}", err=True)
    mistakes, count = findings.mistakes, len(findings.mistakes)
    own = len(findings.files) - findings.shipped
    shipped = plural(findings.shipped, "shipped file")
    checked = plural(own, "file") if own else shipped
    checked += f" and {shipped}" if own and findings.shipped else ""
    if as_json:
        row = {
            "files": [str(path) for path in findings.files],
            "mistakes": [plain_mistake(mistake) for mistake in mistakes],
            "notes": [plain_mistake(note) for note in findings.notes],
        }
        echo(json.dumps(row))
    elif mistakes:
        echo(*mistakes, err=True)
        wrong = list(dict.fromkeys(str(mistake.place.path) for mistake in mistakes))
        where = ", ".join(wrong) if len(wrong) <= _MOST_NAMED else plural(len(wrong), "file")
        echo(f"{plural(count, 'mistake')} in {where}; {checked} checked", err=True)
    else:
        right = f"{checked} {'is' if len(findings.files) == 1 else 'are'} right"
        notes = f"no mistakes, but {plural(len(findings.notes), 'note')}; {checked} checked"
        echo(notes if findings.notes else right)
    if mistakes:
        sys.exit(FileError.exit_status)


@command()
@trees_option
@robot_option
@skills_option
@_output_option
def schema(trees: Path | None, robot: Path | None, output: Path | None) -> None:
    """Print the JSON Schema of task files. Editors use it to complete and check task files.

    The schema includes your own skills and subtrees.
    """
    from trees.export.schema import schema_text

    text = schema_text(load_library(trees, robot)[1])
    if output:
        write_file(output, text.encode())
        echo(output)
    else:
        echo(text, nl=False, whole=True)


@command()
@skills_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per skill.")
def skills(as_json: bool) -> None:
    """List the skills, with their ports."""
    from trees.compile.port_types import declarations, known_skills

    for name, kind in sorted(known_skills().items()):
        ports = declarations(kind)
        description = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
        if as_json:
            rows = {
                port: {
                    "type": declared.type,
                    "output": declared.output,
                    "needed": declared.needed,
                    "description": declared.description,
                }
                for port, declared in ports.items()
            }
            echo(json.dumps({"skill": name, "description": description, "ports": rows}))
            continue
        echo(f"{name}\n    {description}")
        for port, declared in ports.items():
            verb = "writes" if declared.output else "reads"
            default = "" if declared.needed else f", default {declared.default!r}"
            accepted = f"{declared}{declared.limits}{default}"
            echo(f"      {verb:<6} {port:<12} {accepted}: {declared.description}")


@command()
@click.argument("subject", metavar="TASK|RECORDING", type=TASK_OR_RECORDING)
@trees_option
@skills_option
@robot_option
@click.option("--ports", is_flag=True, help="Show the ports and their values.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "mermaid", "dot", "svg", "groot"]),
    default="text",
    show_default=True,
    help="groot: XML for Groot2 and BehaviorTree.CPP 4.",
)
@_output_option
def show(
    subject: int | str | Path,
    trees: Path | None,
    robot: Path | None,
    ports: bool,
    form: str,
    output: Path | None,
) -> None:
    """Draw the tree of a task or of a recorded run.

    TASK is the number or the name of a task. RECORDING is a file, `latest`, `latest:TASK`, or the
    beginning of a name in the folder of recordings. In the tree of a recording, colours show how
    each node ended, and when.
    """
    from trees.check import compile_task
    from trees.export.drawings import DRAWINGS
    from trees.export.groot import as_groot
    from trees.export.outline import outline

    if not isinstance(subject, Path):
        loaded, library = load_library(trees, robot)
        number = library.number(subject)
        root = outline(compile_task(loaded, library, number))
        text = as_groot(root, number) if form == "groot" else DRAWINGS[form](root, ports)
    elif ports or form == "groot":
        raise click.UsageError("--ports and --format groot need a task")
    else:
        from executive.replay.recorded_tree import tree_of

        text = DRAWINGS[form](tree_of(subject), False)
    if output:
        write_file(output, f"{click.unstyle(text)}\n".encode())
        echo(output)
    else:
        shown = fit(text, sys.stdout) if form == "text" else escaped(text)
        click.echo(shown)  # noqa: TID251, it has colours
    if isinstance(subject, Path):
        sys.exit(print_incomplete(subject))


@command()
@click.argument("number", type=Whole(0, 2**31 - 1))
@click.argument("name")
@own_trees_option
@robot_option
@skills_option
def new(number: int, name: str, trees: Path, robot: Path | None) -> None:
    """Write a new task file: a commented example that runs.

    A task belongs to a robot, so it is written to the subfolder of --trees with the name of the
    robot.

    \b
    Example:
      armtree new 3 wave
    """  # noqa: D301
    from hardware import load_robot
    from trees.writing.new_task import write_task

    path = write_task(load_robot(robot), trees, number, name)
    options = given_options(click.get_current_context(), "trees", "robot")
    given = "".join(f" {shlex.quote(word)}" for word in options)
    echo(f"{path}\nNext, type: armtree check{given}, then armtree run {number}{given}", whole=True)
