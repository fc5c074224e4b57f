"""The grammar of task and subtree files: a located document in, checked values out.

What a skill's name or port means is not known here; the builder above checks that.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from .document import Located, nested, read_document
from .errors import FileError, Mistake, Place

MAX_NUMBER = 2**31 - 1
COMPOSITES = ("sequence", "parallel")


@dataclass(frozen=True, slots=True)
class Key:
    """A value by name, `$name` in a file: a port of the subtree or a key of the blackboard."""

    place: Place
    name: str


Value = Located | Key


@dataclass(frozen=True, slots=True)
class SkillNode:
    """A leaf.

    Attributes:
        place: Where it stands.
        skill: Name of the skill.
        ports: What its ports are wired to.
    """

    place: Place
    skill: str
    ports: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class CompositeNode:
    """Several nodes: one after the other (`sequence`) or at once (`parallel`).

    A parallel waits until all its children have ended, then fails if any of them did.
    """

    place: Place
    kind: str
    children: "tuple[TreeNode, ...]"


@dataclass(frozen=True, slots=True)
class SubtreeNode:
    """A subtree from a file of its own.

    Attributes:
        place: Where it stands.
        name: Which.
        values: What its ports are wired to.
    """

    place: Place
    name: str
    values: Mapping[str, Value]


TreeNode = SkillNode | CompositeNode | SubtreeNode


@dataclass(frozen=True, slots=True)
class TaskFile:
    """A numbered task, checked.

    Attributes:
        path: Its file.
        text: The file as it was read.
        number: Task number.
        name: One word.
        description: What it does.
        tree: What to do.
    """

    path: Path
    text: str
    number: int
    name: str
    description: str
    tree: TreeNode


@dataclass(frozen=True, slots=True)
class SubtreeFile:
    """A tree that tasks share.

    Attributes:
        path: Its file.
        text: The file as it was read.
        name: One word.
        ports: What it must be given.
        tree: What to do.
    """

    path: Path
    text: str
    name: str
    ports: tuple[str, ...]
    tree: TreeNode


def parse_task(path: Path, text: str) -> TaskFile:
    """Check a task file.

    Raises:
        FileError: With every mistake in it.
    """
    parser = _Parser(read_document(path, text), ("task", "name", "description", "tree"))
    task = TaskFile(
        path=path,
        text=text,
        number=parser.number("task"),
        name=parser.word("name"),
        description=parser.word("description"),
        tree=parser.tree("tree"),
    )
    parser.done()
    return task


def parse_subtree(path: Path, text: str) -> SubtreeFile:
    """Check a subtree file.

    Raises:
        FileError: With every mistake in it.
    """
    parser = _Parser(read_document(path, text), ("subtree", "description", "ports", "tree"))
    parser.word("description")
    subtree = SubtreeFile(
        path=path,
        text=text,
        name=parser.word("subtree"),
        ports=parser.words("ports"),
        tree=parser.tree("tree"),
    )
    parser.done()
    return subtree


class _Parser:
    """Reads the keys of a file and collects the mistakes."""

    def __init__(self, root: Located, keys: tuple[str, ...]) -> None:
        self._root, self._values = root, nested(root)
        self._mistakes: list[Mistake] = []
        if not self._values:
            self._wrong(root, f"expected the keys {', '.join(keys)}")
        for key, value in self._values.items():
            if key not in keys:
                self._wrong(value, f"unknown key {key}; there are {_choices(key, keys)}")

    def done(self) -> None:
        """Raise what was collected."""
        if self._mistakes:
            raise FileError(self._mistakes)

    def number(self, key: str) -> int:
        value = self._get(key)
        if value is not None:
            number = value.value
            if type(number) is int and 0 <= number <= MAX_NUMBER:
                return number
            self._wrong(value, f"{key}: {value.plain()!r} is no number from 0 to {MAX_NUMBER}")
        return 0

    def word(self, key: str) -> str:
        value = self._get(key)
        if value is None:
            return ""
        if not isinstance(value.value, str) or not value.value.strip():
            self._wrong(value, f"{key}: {value.plain()!r} is not a text")
            return ""
        return value.value

    def words(self, key: str) -> tuple[str, ...]:
        value = self._get(key)
        if value is None:
            return ()
        plain = value.plain()
        if not isinstance(plain, list) or not all(isinstance(word, str) for word in plain):
            self._wrong(value, f"{key}: {plain!r} is not a list of names")
            return ()
        return tuple(plain)

    def tree(self, key: str) -> TreeNode:
        value = self._get(key)
        return self._node(value) if value else SkillNode(self._root.place, "", {})

    def _get(self, key: str) -> Located | None:
        value = self._values.get(key)
        if value is None and self._values:
            self._wrong(self._root, f"the key {key} is missing")
        return value

    def _node(self, value: Located) -> TreeNode:
        if isinstance(value.value, str):
            return SkillNode(value.place, value.value, {})
        keys = nested(value)
        if "subtree" in keys:
            return self._subtree(value, keys)
        if len(keys) != 1:
            said = f"not {', '.join(keys)}" if keys else f"not {value.plain()!r}"
            kinds = f"{', '.join(COMPOSITES)}, subtree, or a skill's name"
            self._wrong(value, f"a node is one of {kinds}, {said}")
            return SkillNode(value.place, "", {})
        ((kind, inner),) = keys.items()
        if kind in COMPOSITES:
            return self._composite(value.place, kind, inner)
        return SkillNode(value.place, kind, self._wiring(inner, f"the ports of {kind}"))

    def _composite(self, place: Place, kind: str, inner: Located) -> CompositeNode:
        if not isinstance(inner.value, list) or not inner.value:
            self._wrong(inner, f"{kind} needs a list of nodes, not {inner.plain()!r}")
            return CompositeNode(place, kind, ())
        return CompositeNode(place, kind, tuple(self._node(item) for item in inner.value))

    def _subtree(self, value: Located, keys: Mapping[str, Located]) -> TreeNode:
        for key, other in keys.items():
            if key not in ("subtree", "with"):
                self._wrong(other, f"unknown key {key}; beside subtree there is only with")
        name = keys["subtree"]
        if not isinstance(name.value, str):
            self._wrong(name, f"subtree: {name.plain()!r} is not a name")
            return SkillNode(value.place, "", {})
        values = self._wiring(keys["with"], "with") if "with" in keys else {}
        return SubtreeNode(value.place, name.value, values)

    def _wiring(self, value: Located, what: str) -> dict[str, Value]:
        if not isinstance(value.value, dict):
            self._wrong(value, f"{what} must be a mapping, not {value.plain()!r}")
            return {}
        return {port: _wired(item) for port, item in value.value.items()}

    def _wrong(self, value: Located, message: str) -> None:
        self._mistakes.append(Mistake(value.place, message))


def _wired(value: Located) -> Value:
    if isinstance(value.value, str) and value.value.startswith("$"):
        return Key(value.place, value.value[1:])
    return value


def _choices(word: str, known: tuple[str, ...]) -> str:
    near = get_close_matches(word, known, n=1)
    return ", ".join(known) + (f"; did you mean {near[0]}?" if near else "")
