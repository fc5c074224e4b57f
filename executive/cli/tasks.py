"""The commands around task files: list, check, show, begin one, and what may stand in them."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .incomplete import incomplete
from .options import PATH, recordings_option, robot_option, skills_option, trees_option

if TYPE_CHECKING:
    from trees import Declaration


@click.command()
@trees_option
@recordings_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per task.")
def tasks(trees: Path | None, recordings: Path, as_json: bool) -> None:
    """List the tasks there are."""
    from trees import FileError, Library

    from .outcomes import last_outcomes

    library = Library(trees)
    mistakes = list(library.mistakes)
    outcomes = last_outcomes(recordings)
    for number in library.numbers():
        try:
            task = library.head(number)
        except FileError as error:
            mistakes += error.mistakes
            if not as_json:
                click.echo(f"{number:>4}  is wrong", err=True)
            continue
        row = {
            "task": number,
            "name": task.name,
            "description": task.description,
            "source": "shipped" if task.path.parent in library.shipped else str(task.path),
            "parameters": {name: _declared(p) for name, p in task.parameters.items()},
            "last_outcome": outcomes.get(number, ""),
        }
        click.echo(json.dumps(row) if as_json else _row(row))
    if mistakes:
        raise FileError(mistakes)


def _row(row: dict[str, Any]) -> str:
    lines = [f"{row['task']:>4}  {row['name']:<12} {row['description']}"]
    told = [row["source"]]
    told += [f"--set {name}={declared}" for name, declared in row["parameters"].items()]
    told += [f"last: {row['last_outcome']}"] if row["last_outcome"] else []
    return "\n".join([*lines, *(f"{'':<19}{line}" for line in told)])


def _declared(declared: "Declaration") -> str:
    """A parameter in a few words."""
    default = declared.default
    text = default is not None and isinstance(default.value, str)
    value = "" if default is None else f" {default.value if text else default}"
    bounds = ""
    if declared.least is not None or declared.most is not None:
        least = "" if declared.least is None else f"{declared.least:g}"
        most = "" if declared.most is None else f"{declared.most:g}"
        bounds = f", {least}..{most}{' ' + declared.unit if declared.unit else ''}"
    choices = f", {'|'.join(declared.choices)}" if declared.choices else ""
    return f"{declared.type.upper()}{bounds}{choices}" + (f" (default{value})" if value else "")


@click.command()
@click.argument("files", metavar="[FILE]...", nargs=-1, type=PATH)
@trees_option
@skills_option
@robot_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(
    files: Sequence[Path],
    trees: Path | None,
    skills: Path | None,
    robot: Path | None,
    as_json: bool,
) -> None:
    """Find every mistake in task files, without moving anything. Without FILE: in all of them."""
    source = click.get_current_context().get_parameter_source("trees")
    if files and source is click.core.ParameterSource.COMMANDLINE:
        raise click.UsageError("--trees goes without FILE, which is checked with its own folder")
    from hardware import load_robot
    from trees import FileError
    from trees.check import check as find

    findings = find(load_robot(robot), trees, files)
    for note in findings.notes:
        click.echo(f"note: {note.place} {note.message}", err=True)
    if as_json:
        click.echo(json.dumps(_findings(findings)))
    elif findings.mistakes:
        click.echo("\n".join(map(str, findings.mistakes)), err=True)
        count = len(findings.mistakes)
        told = "1 mistake" if count == 1 else f"{count} mistakes"
        click.echo(f"{told} in {len(findings.files)} files", err=True)
    else:
        click.echo(f"{len(findings.files)} files are right")
    if findings.mistakes:
        sys.exit(FileError.exit_status)


def _findings(findings: Any) -> dict[str, Any]:
    mistakes = [
        {
            "file": str(mistake.place.path),
            "line": mistake.place.line,
            "column": mistake.place.column,
            "path": mistake.place.way,
            "message": mistake.message,
        }
        for mistake in findings.mistakes
    ]
    return {"files": [str(path) for path in findings.files], "mistakes": mistakes}


@click.command()
@trees_option
@skills_option
@click.option("-o", "--output", type=PATH, help="File to write; default: standard output.")
def schema(trees: Path | None, skills: Path | None, output: Path | None) -> None:
    """Print the JSON Schema of task files, for editors; it knows your skills and subtrees too."""
    from trees import Library
    from trees.export.schema import schema_text

    text = schema_text(Library(trees))
    if output:
        output.write_text(text)
        click.echo(output)
    else:
        click.echo(text, nl=False)


@click.command()
@skills_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per skill.")
def skills(skills: Path | None, as_json: bool) -> None:
    """List the skills there are, with their ports."""
    from trees.compile.port_types import declarations, known_skills

    for name, kind in sorted(known_skills().items()):
        ports = declarations(kind)
        words = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
        if as_json:
            rows = {
                port: {
                    "type": p.type,
                    "output": p.output,
                    "needed": p.needed,
                    "description": p.description,
                }
                for port, p in ports.items()
            }
            click.echo(json.dumps({"skill": name, "description": words, "ports": rows}))
            continue
        click.echo(f"{name}\n    {words}")
        for port, declared in ports.items():
            arrow = "writes" if declared.output else "reads"
            default = "" if declared.needed else f", default {declared.default!r}"
            click.echo(f"      {arrow:<6} {port:<12} {declared}{default}: {declared.description}")


@click.command()
@click.argument("task", metavar="TASK|RECORDING")
@trees_option
@skills_option
@robot_option
@click.option("--ports", is_flag=True, help="Show what ports are wired to.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "mermaid", "dot", "svg", "groot"]),
    default="text",
    show_default=True,
    help="groot: XML for Groot2 and BehaviorTree.CPP 4.",
)
@click.option("-o", "--output", type=PATH, help="File to write; default: standard output.")
def show(
    task: str,
    trees: Path | None,
    skills: Path | None,
    robot: Path | None,
    ports: bool,
    form: str,
    output: Path | None,
) -> None:
    """Show the tree of a task; of a RECORDING, coloured by what happened, with times."""
    from hardware import load_robot
    from trees import Library
    from trees.check import compile_task
    from trees.export.drawings import DRAWINGS
    from trees.export.groot import as_groot
    from trees.export.outline import outline

    if task.isdecimal():
        number = int(task)
        root = outline(compile_task(load_robot(robot), Library(trees), number))
        text = as_groot(root, number) if form == "groot" else DRAWINGS[form](root, ports)
    elif ports or form == "groot":
        raise click.UsageError("--ports and --format groot go with the number of a task")
    else:
        from executive.replay.replayed_run import tree_of

        text = DRAWINGS[form](tree_of(Path(task)), False)
    if output:
        output.write_text(click.unstyle(text) + "\n")
        click.echo(output)
    else:
        click.echo(text)
    if not task.isdecimal():
        sys.exit(incomplete(Path(task)))


@click.command()
@click.argument("number", type=click.IntRange(0, 2**31 - 1))
@click.argument("name")
@click.option(
    "--trees",
    type=PATH,
    envvar="ARMTREE_TREES",
    default=Path("trees"),
    show_default=True,
    help="Folder to write it to; made if it is not there.",
)
@skills_option
def new(number: int, name: str, trees: Path, skills: Path | None) -> None:
    """Begin a task NUMBER called NAME: a file with comments that runs as it is."""
    from .new_task import write_task

    path = write_task(trees, number, name)
    given = "" if trees == Path("trees") else f" --trees {trees}"
    click.echo(f"{path}\nNext, type: armtree check{given}, then armtree run {number}{given}")


COMMANDS = (tasks, check, schema, skills, show, new)
