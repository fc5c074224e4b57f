"""Wrong task files, and what `armtree check` says of them: `tests/data/wrong_tasks.txt`.

`python -m tests.support.generated.wrong_tasks` writes the messages again.
The number after a file's name is the number of lines of `TASK` with which the file begins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from hardware import Robot, load_robot
from tests.support.paths import DATA
from trees.check import check
from trees.errors import Correction, Mistake

TASK = """task: 20
name: m
description: One mistake.
tree:
  sequence:
    - subtree: reach
      with: {arm: upright, gripper: open}
    - subtree: move_joints
      with: {joints: {joint_1: 20 deg}}
"""

_LINES = TASK.splitlines(keepends=True)
TARGET = DATA / "wrong_tasks.txt"
_CASE, _FILE, _SAID = "=== ", "--- ", ">>>"


def corrected(text: str, correction: Correction) -> str:
    """The text of a file with a correction."""
    lines, first = text.split("\n"), correction.line - 1
    lines[first : first + correction.count] = correction.text.split("\n")
    return "\n".join(lines)


@dataclass(frozen=True)
class Case:
    """A folder of wrong files.

    Attributes:
        files: Texts by name.
        said: What is printed.
    """

    files: Mapping[str, str]
    said: str


def cases() -> dict[str, Case]:
    """Return the cases by name."""
    found = dict[str, Case]()
    for block in TARGET.read_text().split(f"\n{_CASE}")[1:]:
        name, _, rest = block.partition("\n")
        given, _, said = rest.partition(f"\n{_SAID}\n")
        files = dict[str, str]()
        for part in f"\n{given}".split(f"\n{_FILE}")[1:]:
            head, _, text = part.partition("\n")
            file, _, shared = head.partition(" ")
            files[file] = "".join(_LINES[: int(shared or 0)]) + f"{text}\n"
        found[name] = Case(files, said.strip("\n"))
    return found


def mistakes_of(
    robot: Robot, folder: Path, given: Sequence[Mapping[str, str]]
) -> list[list[Mistake]]:
    """Return the mistakes of each of several folders of files, which are checked at once."""
    paths = list[Path]()
    for number, files in enumerate(given):
        below = folder / str(number)
        below.mkdir()
        for name, text in files.items():
            paths.append(below / name)
            paths[-1].write_text(text)
    found: list[list[Mistake]] = [[] for _ in given]
    findings = check(robot, None, paths)
    for mistake in findings.mistakes:
        found[int(mistake.place.path.parent.name)].append(mistake)
    return found


def said(mistakes: Sequence[Mistake]) -> str:
    """Return what is printed of mistakes, with names of files instead of paths."""
    text = "\n".join(map(str, mistakes))
    for parent in {str(mistake.place.path.parent) for mistake in mistakes}:
        text = text.replace(f"{parent}/", "")
    return text


def write(given: Mapping[str, Mapping[str, str]]) -> None:
    """Write the cases, with what is printed of them now."""
    with TemporaryDirectory() as folder:
        found = mistakes_of(load_robot(None), Path(folder), list(given.values()))
    blocks = ["Wrong files, and what `armtree check` prints of each."]
    for (name, files), mistakes in zip(given.items(), found, strict=True):
        texts = [f"{_FILE}{file}{_shortened(text.rstrip())}" for file, text in files.items()]
        blocks.append("\n".join([f"{_CASE}{name}", *texts, _SAID, said(mistakes)]))
    TARGET.write_text("\n\n".join(blocks) + "\n")


def _shortened(text: str) -> str:
    """Return the number of lines that a text shares with `TASK`, and its other lines."""
    lines = text.splitlines(keepends=True)
    pairs = enumerate(zip(lines, _LINES, strict=False))
    shared = next((row for row, (line, usual) in pairs if line != usual), len(_LINES))
    return (f" {shared}\n" if shared else "\n") + "".join(lines[shared:])


if __name__ == "__main__":
    write({name: case.files for name, case in cases().items()})
