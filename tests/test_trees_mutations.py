"""A slip of the finger in a file that ships: refused, harmless, or just what was written.

A letter, a digit or an indent is changed. What still passes says, value by value, the same as
before, except where the change stands; and what says the same is built to the same task.
"""

import random
from pathlib import Path

import pytest

import trees
from executive.building.builder import build
from executive.building.check import check
from executive.building.plugins import load_skills
from executive.building.resolved import RESOLVED
from tests.test_executive_builder import Shop, shop  # noqa: F401  a fixture
from trees import Library
from trees.document import read_document

SHIPPED = Path(trees.__file__).parent
EXAMPLES = SHIPPED / "examples"
FILES = sorted([*SHIPPED.glob("[0-9]*.yaml"), *EXAMPLES.glob("[0-9]*.yaml")])
EACH = 15  # changes per file
SIGNS = "abz019 -:{}[],$#\t'\"&*!|>%@.\n"


def changed(text: str, row: int, rng: random.Random) -> str:
    """The text with one slip in a row."""
    lines = text.split("\n")
    line = lines[row]
    column = rng.randrange(len(line) + 1)
    match rng.randrange(4):
        case 0:
            line = line[:column] + rng.choice(SIGNS) + line[column + 1 :]
        case 1:
            line = line[:column] + rng.choice(SIGNS) + line[column:]
        case 2:
            line = line[:column] + line[column + 1 :]
        case _:
            deeper = rng.random() < 0.5
            line = " " * rng.randint(1, 4) + line if deeper else line[rng.randint(1, 4) :]
    lines[row] = line
    return "\n".join(lines)


Said = dict[str, object]  # what a file says, by the way there


def said(path: Path, text: str) -> tuple[Said, dict[str, int]]:
    """What a file says, and the line where it stands."""
    found: Said = {}
    lines: dict[str, int] = {}
    left = [read_document(path, text)]
    while left:
        value = left.pop()
        inner = value.value
        if isinstance(inner, dict | list) and inner:
            left += inner.values() if isinstance(inner, dict) else inner
        else:
            found[value.place.way] = value.plain()
            lines[value.place.way] = value.place.line
    return found, lines


@pytest.mark.parametrize("file", FILES, ids=[path.stem for path in FILES])
def test_slips(shop: Shop, file: Path) -> None:  # noqa: F811
    assert not load_skills(EXAMPLES / "skills")
    texts = {path.name: path.read_text() for path in FILES}
    for path in FILES:
        if path.parent == SHIPPED:
            texts[path.name] += f"replaces: {path.stem.partition('_')[2]}\n"
        (shop.folder / path.name).write_text(texts[path.name])
    number, path, text = int(file.stem.partition("_")[0]), shop.folder / file.name, texts[file.name]

    def task() -> str:
        library = Library(shop.folder)
        tree = build(library.draft(number), library, shop.context, "run")
        tree.discard()
        return tree.files[RESOLVED]

    (before, old), same, rng = said(path, text), task(), random.Random(number)
    for _ in range(EACH):
        row = rng.randrange(1, text.count("\n"))
        slip = changed(text, row, rng)
        path.write_text(slip)
        mistakes = check(shop.context.robot, shop.folder, [path]).mistakes
        assert all(m.place.line and m.place.path == path for m in mistakes), slip
        if mistakes:
            continue
        after, new = said(path, slip)
        if before == after:
            assert task() == same, slip
        here = (row + 1, row + 2)  # a slip may break the line
        for way in dict(before.items() ^ after.items()):
            assert old.get(way) in here or new.get(way) in here, f"{way} changed: {slip}"
