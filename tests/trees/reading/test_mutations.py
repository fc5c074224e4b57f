"""A slip of the finger in a file that ships: refused, harmless, or just what was written.

A letter, a digit or an indent is changed, a line is lost or doubled. What still passes says, value
by value, the same as before, except where the change stands; and what says the same is built to
the same task. ARMTREE_SLIPS tries more of them.
"""

import os
import random
from pathlib import Path

import pytest

from skills.user_skills import load_skills
from tests.support.paths import EXAMPLES, TASKS
from tests.trees.test_build import Shop, shop  # noqa: F401  a fixture
from trees import Library
from trees.build import build
from trees.check import check
from trees.export.resolved import RESOLVED
from trees.nodes.kind import reserved_names
from trees.reading.grammar import parse_value

pytestmark = pytest.mark.slow

OWN = [*TASKS.glob("*.yaml"), *(TASKS / "arduinobot").glob("*.yaml")]
FILES = sorted([*OWN, *EXAMPLES.glob("*.yaml")])
EACH = int(os.environ.get("ARMTREE_SLIPS", "3"))  # changes per file
SIGNS = "abz019 -:{}[],$#\t'\"&*!|>%@.\n"
PLACE_OF = "\nreplaces: "  # what makes a copy take the place of a shipped file


def copied(path: Path) -> str:
    """The text of a file that may stand in a user's folder."""
    text = path.read_text()
    if path.parent == EXAMPLES:
        return text
    if path.name == "poses.yaml":
        names = [line.split(":")[0].strip() for line in text.splitlines() if line[0] == " "]
        return f"{text.rstrip()}{PLACE_OF}[{', '.join(names)}]\n"
    return f"{text.rstrip()}{PLACE_OF}{path.stem.lstrip('0123456789_')}\n"


def changed(text: str, row: int, rng: random.Random) -> tuple[str, bool]:
    """The text with one slip in a row, and whether all other rows stay where they are."""
    lines = text.split("\n")
    line = lines[row]
    column = rng.randrange(len(line) + 1)
    match rng.randrange(6):
        case 0:
            line = line[:column] + rng.choice(SIGNS) + line[column + 1 :]
        case 1:
            line = line[:column] + rng.choice(SIGNS) + line[column:]
        case 2:
            line = line[:column] + line[column + 1 :]
        case 3:
            deeper = rng.random() < 0.5
            line = " " * rng.randint(1, 4) + line if deeper else line[rng.randint(1, 4) :]
        case 4:
            return "\n".join(lines[:row] + lines[row + 1 :]), False
        case _:
            return "\n".join([*lines[:row], line, *lines[row:]]), False
    lines[row] = line
    return "\n".join(lines), True


Said = dict[str, object]  # what a file says, by the way there


def said(path: Path, text: str) -> tuple[Said, dict[str, int]]:
    """What a file says, and the line where it stands."""
    found: Said = {}
    lines: dict[str, int] = {}
    left = [parse_value(text, str(path))]
    while left:
        value = left.pop()
        inner = value.value
        if isinstance(inner, dict | list) and inner:
            left += inner.values() if isinstance(inner, dict) else inner
        else:
            found[value.place.location] = value.plain()
            lines[value.place.location] = value.place.line
    return found, lines


@pytest.mark.parametrize("file", FILES, ids=[path.stem for path in FILES])
def test_slips(shop: Shop, file: Path) -> None:  # noqa: F811
    assert not load_skills(EXAMPLES / "skills", reserved_names())
    texts = {path.name: copied(path) for path in FILES}
    for name, text in texts.items():
        (shop.folder / name).write_text(text)
    path, text, rng = shop.folder / file.name, texts[file.name], random.Random(file.name)
    assert not check(shop.context.robot, shop.folder, [path]).mistakes

    def tasks() -> list[str]:
        library, made = Library(shop.folder), []
        for number in library.numbers():
            tree = build(library.draft(number), library, shop.context, "run")
            tree.discard()
            made.append(tree.files[RESOLVED])
        return made

    (before, old), same = said(path, text), tasks()
    for _ in range(EACH):
        row = rng.randrange(1, text.count("\n"))
        slip, stays = changed(text, row, rng)
        path.write_text(slip)
        mistakes = check(shop.context.robot, shop.folder, [path]).mistakes
        assert all(m.place.path == path and m.place.excerpt for m in mistakes), slip
        if mistakes:
            continue
        after, new = said(path, slip)
        if before == after:
            assert tasks() == same, slip
        here = (row + 1, row + 2)  # a slip may break the line
        for way in dict(before.items() ^ after.items()) if stays else ():
            assert old.get(way) in here or new.get(way) in here, f"{way} changed: {slip}"
