"""Writes what the documentation takes from the code and from files beside the pages.

A hook of MkDocs: the line `<!-- generated: NAME -->` of a page becomes what `GENERATED[NAME]`
returns, and `INCLUDED` adds pages that lie elsewhere in the repository.
"""

import inspect
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from enum import EnumType
from pathlib import Path
from typing import Any, get_args

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import armtree
from docs.fields_table import table as fields
from executive.api.operations import OPERATIONS
from executive.cli.main import SECTIONS, cli
from executive.cli.settings.rows import SETTINGS, environment_name
from executive.code_table import meaning
from tests.support.codes import all_codes
from trees.compile.port_types import declarations, known_skills

ROOT = Path(__file__).parents[1]
INCLUDED = {
    "reference/changelog.md": "CHANGELOG.md",
    "reference/contributing.md": ".github/CONTRIBUTING.md",
    "reference/dependencies.md": "docs/dependencies.md",
    "reference/licence.md": "docs/LICENSE",
    "reference/output.schema.json": "docs/output.schema.json",
    "reference/security.md": ".github/SECURITY.md",
    "troubleshooting/faults.md": "docs/faults.md",
}
_LINKS = {
    "LICENSE": "licence.md",
    "../docs/LICENSE": "licence.md",
    "../docs/dependencies.md": "dependencies.md",
}
# Pages of names and versions hide the others in the search. The rank of a page is its factor there.
_NOT_SEARCHED = {"reference/changelog.md", "reference/dependencies.md", "reference/licence.md"}
_RANKED = {
    "start.md": 2,
    "install.md": 2,
    "safety.md": 2,
    "how_to/index.md": 0.5,
    "how_to/own_driver.md": 0.5,
    "how_to/": 2,
    "troubleshooting/index.md": 4,
    "troubleshooting/messages.md": 2,
    "reference/tasks.md": 2,
    "reference/command_line.md": 0.3,
    "reference/python.md": 0.3,
    "reference/exit_codes.md": 0.3,
}
_WIDTH = 80  # longest line of a signature, if its parameters fit
_FAMILIES = {
    "file": "Files",
    "fleet": "Fleets",
    "goal": "Goals",
    "hw": "Hardware",
    "log": "Recordings",
    "plan": "Planning",
    "request": "Requests to a server",
    "server": "Servers",
    "task": "Tasks",
}
_MARKER = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)
_STATUS = re.compile(r"(\d+) (\S.*?)(?:  |$)", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)([^)]+)\)")
_SECTION = re.compile(
    r"^(Args|Attributes|Raises|Returns|Yields):\n((?:    .*\n?|\n)+)", re.MULTILINE
)
_NAMED = r"`\1`: "
_ITEM = re.compile(r"^(\w+): ")
_ROOMS = ("executive", "hardware", "logs", "skills", "trees")
# Modules before the name of a class that no other package has.
_MODULES = re.compile(rf"\b(?:{'|'.join(_ROOMS)}|collections|pathlib|typing)\.(?:\w+\.)*(\w+)")
_EVENT = " | ".join(each.__name__ for each in get_args(armtree.Event))


def command_line() -> Iterator[str]:
    """Yield the help of every command, by section."""
    shown: Any = {"info_name": "armtree", "terminal_width": 80, "max_content_width": 80}
    context = click.Context(cli, **shown, **cli.context_settings)
    for title, places in SECTIONS.items():
        yield f"## {title}"
        for place in places:
            name = place.rpartition(".")[2].strip("_").replace("_", "-")
            command = cli.get_command(context, name)
            assert command, name
            yield from _command(command, context, f"armtree {name}", "###")


def _command(command: click.Command, above: click.Context, name: str, level: str) -> Iterator[str]:
    context = click.Context(command, above, info_name=name.rpartition(" ")[2])
    yield f"{level} `{name}`\n\n```text\n{command.get_help(context)}\n```"
    if isinstance(command, click.Group):
        for inner in command.list_commands(context):
            found = command.get_command(context, inner)
            assert found, inner
            yield from _command(found, context, f"{name} {inner}", "####")


def codes() -> Iterator[str]:
    """Yield a table of the codes of each family."""
    families = defaultdict[str, list[str]](list)
    for code, kind in all_codes().items():
        what = (
            f"{meaning(kind)}. | {_sentence(kind.hint)} | {kind.exit_status} | {kind.http_status}"
        )
        row = f"| `{code}` | {what} |"
        family = code.partition(".")[0]
        families[_FAMILIES.get(family, "Others")].append(row)
    for title in sorted(families, key=lambda each: (each == "Others", each)):
        head = "| code | what happened | what to do | exit status | HTTP status |"
        head += "\n|---|---|---|---|---|"
        yield "\n".join((f"## {title}\n", head, *families[title]))


def _sentence(hint: str) -> str:
    return f"{hint[0].upper()}{hint[1:]}."


def exit_statuses() -> Iterator[str]:
    """Yield a table of the exit statuses: their meaning in the help, and their codes."""
    codes = defaultdict[int, list[str]](list)
    for code, kind in all_codes().items():
        codes[kind.exit_status].append(f"`{code}`")
    _, _, listed = (cli.help or "").partition("Exit status:")
    meanings = {int(number): words for number, words in _STATUS.findall(listed)}
    rows = (
        f"| {each} | {meanings[each]} | {', '.join(codes[each])} |" for each in sorted(meanings)
    )
    yield "\n".join(("| exit status | meaning | codes |\n|---|---|---|", *rows))


def settings() -> Iterator[str]:
    """Yield a table of the settings."""
    rows = [
        f"| `{name}` | `--{name.replace('_', '-')}` | `{environment_name(name)}` | {row.help} |"
        for name, row in SETTINGS.items()
    ]
    yield "\n".join(("| key | option | environment | meaning |\n|---|---|---|---|", *rows))


def operations() -> Iterator[str]:
    """Yield a table of the operations of a server."""
    rows = [
        f"| `{each.method} {each.path}` | {each.summary} | {each.access.name.lower()} |"
        for each in OPERATIONS.values()
    ]
    yield "\n".join(("| request | answer | access |\n|---|---|---|", *rows))


def skills() -> Iterator[str]:
    """Yield every skill that ships, with its ports."""
    for name, kind in sorted(known_skills().items()):
        if not kind.__module__.startswith("skills."):
            continue
        yield f"## `{name}`\n\n{_text(inspect.getdoc(kind) or '')}"
        rows = [
            f"| `{port}` | {'writes' if each.output else 'reads'} | "
            f"{_cell(f'{each}{each.limits}')} | "
            f"{'-' if each.needed else f'`{each.default!r}`'} | {_cell(each.description)} |"
            for port, each in declarations(kind).items()
        ]
        if rows:
            head = "| port | use | type | default | meaning |\n|---|---|---|---|---|"
            yield "\n".join((head, *rows))


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def python() -> Iterator[str]:
    """Yield the public Python interface."""
    for name in sorted(armtree.__all__, key=str.lower):
        thing: Any = getattr(armtree, name)
        yield f"## `armtree.{name}`"
        if not callable(thing):
            yield f"A value of type `{type(thing).__name__}`."
            continue
        if isinstance(thing, EnumType):
            members: Any = thing.__members__.items()
            yield f"One of {', '.join(f'`{each}` ({value.value})' for each, value in members)}."
        else:
            yield _signature(name, thing)
        yield _text(inspect.getdoc(thing) or "")
        if inspect.isclass(thing) and not issubclass(thing, BaseException):
            for inner, member in inspect.getmembers(thing):
                alias = getattr(member, "__name__", inner) != inner  # an old name
                if not (alias or inner.startswith("_")) and _is_ours(member):
                    yield f"### `{name}.{inner}`"
                    if inspect.isroutine(member):
                        yield _signature(inner, member)
                    yield _text(inspect.getdoc(member) or "")


def _is_ours(member: Any) -> bool:
    function = member.fget if isinstance(member, property) else member
    module = getattr(function, "__module__", None) or ""
    return (inspect.isroutine(member) or isinstance(member, property)) and module.startswith(_ROOMS)


def _signature(name: str, thing: Any) -> str:
    try:
        line = _MODULES.sub(r"\1", f"{name}{inspect.signature(thing)}")
    except ValueError:
        return ""
    line = line.replace(_EVENT, "Event").replace("PosixPath(", "Path(")
    if inspect.unwrap(thing) is not thing:  # the decorator makes a context of a generator
        line = re.sub(r"-> (Async)?Iterator\[(.*)\]$", r"-> Abstract\1ContextManager[\2]", line)
    if inspect.iscoroutinefunction(thing):
        line = f"async {line}"
    if len(line) > _WIDTH:
        before, _, inner = line.partition("(")
        inner, close, after = inner.rpartition(")")
        line = f"{before}(\n    {_one_a_line(inner)},\n{close}{after}"
    return f"```text\n{line}\n```"


def _one_a_line(parameters: str) -> str:
    """Put each parameter on a line; a comma within brackets separates none."""
    depth, text = 0, ""
    for part in re.split(r"(?<=,) ", parameters):
        text += part
        depth += sum(map(part.count, "([{")) - sum(map(part.count, ")]}"))
        text += " " if depth else "\n    "
    return text.rstrip()


def _text(docstring: str) -> str:
    """Return a docstring of Google's style as Markdown."""

    def section(found: re.Match[str]) -> str:
        lines = inspect.cleandoc(found[2])
        items = [re.sub(r"\s+", " ", each) for each in re.split(r"\n(?=\S)", lines)]
        rows = [f"- {_ITEM.sub(_NAMED, each)}" for each in items]
        return f"**{found[1]}**\n\n" + "\n".join(rows) + "\n\n"

    return _SECTION.sub(section, f"{docstring}\n")


GENERATED: dict[str, Callable[[], Iterator[str]]] = {
    "codes": codes,
    "command_line": command_line,
    "exit_statuses": exit_statuses,
    "fields": lambda: iter(["\n".join(fields())]),
    "operations": operations,
    "python": python,
    "settings": settings,
    "skills": skills,
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that lie elsewhere. Links to what is not in the site become text."""
    for page, source in INCLUDED.items():
        text = (ROOT / source).read_text()
        if source == "docs/LICENSE":
            text = f"# Licence\n\n```text\n{text}\n```\n"
        text = _LINK.sub(_kept_link, text) if page.endswith(".md") else text
        files.append(File.generated(config, page, content=text))
    return files


def _kept_link(found: re.Match[str]) -> str:
    target = _LINKS.get(found[2])
    return f"[{found[1]}]({target})" if target else found[1]


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Put what is generated into a page, and rank the page in the search."""
    path = page.file.src_uri
    if path in _NOT_SEARCHED:
        page.meta["search"] = {"exclude": True}
    else:
        boosts = (boost for start, boost in _RANKED.items() if path.startswith(start))
        page.meta["search"] = {"boost": next(boosts, 1)}
    return _MARKER.sub(lambda found: "\n\n".join(GENERATED[found[1]]()), markdown)
