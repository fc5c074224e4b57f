"""The grammar of task and subtree files: a located document in, checked values out.

What a skill's name or port means is not known here; the builder above checks that.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from .document import Located, nested, read_document
from .errors import FileError, Mistake, Place

MAX_NUMBER = 2**31 - 1
COMPOSITES = ("sequence", "parallel")

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


@dataclass(frozen=True, slots=True)
class Key:
    """A value by name, `$name` in a file: a port of the subtree or a key of the blackboard.

    Attributes:
        place: Where it stands.
        name: Without the $.
        label: Where the port stands that it is wired to.
    """

    place: Place
    name: str
    label: Place


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
        name=parser.name("name"),
        description=parser.line("description"),
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
    parser.line("description")
    subtree = SubtreeFile(
        path=path,
        text=text,
        name=parser.name("subtree"),
        ports=parser.names("ports"),
        tree=parser.tree("tree"),
    )
    parser.used("ports", set(_keys(subtree.tree)))
    parser.done()
    return subtree


class _Parser:
    """Reads the keys of a file and collects the mistakes."""

    def __init__(self, root: Located, keys: tuple[str, ...]) -> None:
        self._root, self._values = root, nested(root)
        self._mistakes: list[Mistake] = []
        if not self._values:
            self._wrong(root.place, f"expected the keys {', '.join(keys)}")
        for key, value in self._values.items():
            if key not in keys:
                self._wrong(value.label, f"unknown key {key}; there are {choices(key, keys)}")

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
            self._wrong(value.place, f"{key}: {value} is no number from 0 to {MAX_NUMBER}")
        return 0

    def name(self, key: str) -> str:
        value = self._get(key)
        return self._name(value, key) if value else ""

    def names(self, key: str) -> tuple[str, ...]:
        value = self._get(key)
        if value is None:
            return ()
        if not isinstance(value.value, list):
            self._wrong(value.place, f"{key}: {value} is not a list of names")
            return ()
        names: list[str] = []
        for item in value.value:
            name = self._name(item, key)
            if name in names and name:
                self._wrong(item.place, f"{key}: {name} is given twice")
            names.append(name)
        return tuple(names)

    def line(self, key: str) -> str:
        value = self._get(key)
        if value is None:
            return ""
        if not isinstance(value.value, str) or not value.value.strip():
            self._wrong(value.place, f"{key}: {value} is not a text")
            return ""
        return " ".join(value.value.split())

    def used(self, key: str, used: set[str]) -> None:
        """See to it that every name of a list is used."""
        value = self._values.get(key)
        for item in value.value if value and isinstance(value.value, list) else []:
            if isinstance(item.value, str) and item.value not in used:
                self._wrong(item.place, f"{key}: nothing in the tree uses ${item.value}")

    def tree(self, key: str) -> TreeNode:
        value = self._get(key)
        return self._node(value) if value else SkillNode(self._root.place, "", {})

    def _get(self, key: str) -> Located | None:
        value = self._values.get(key)
        if value is None and self._values:
            self._wrong(self._root.place, f"the key {key} is missing")
        return value

    def _name(self, value: Located, what: str) -> str:
        if isinstance(value.value, str) and _NAME.fullmatch(value.value):
            return value.value
        rule = "a letter, then letters, digits, _ or -"
        self._wrong(value.place, f"{what}: {value} is not a name ({rule})")
        return ""

    def _node(self, value: Located) -> TreeNode:
        if isinstance(value.value, str):
            return SkillNode(value.place, self._name(value, "a node"), {})
        keys = nested(value)
        if "subtree" in keys:
            return self._subtree(value, keys)
        if len(keys) != 1:
            self._wrong(value.place, _no_node(value, tuple(keys)))
            return SkillNode(value.place, "", {})
        ((kind, inner),) = keys.items()
        if kind in COMPOSITES:
            return self._composite(value.place, kind, inner)
        if isinstance(inner.value, list):
            there = choices(kind, COMPOSITES)
            self._wrong(inner.label, f"only {there} hold a list of nodes, not {kind}")
            return SkillNode(value.place, "", {})
        return SkillNode(value.place, kind, self._wiring(inner, f"the ports of {kind}"))

    def _composite(self, place: Place, kind: str, inner: Located) -> CompositeNode:
        if not isinstance(inner.value, list) or not inner.value:
            self._wrong(inner.place, f"{kind} needs a list of nodes, not {inner}")
            return CompositeNode(place, kind, ())
        return CompositeNode(place, kind, tuple(self._node(item) for item in inner.value))

    def _subtree(self, value: Located, keys: Mapping[str, Located]) -> TreeNode:
        for key, other in keys.items():
            if key not in ("subtree", "with"):
                self._wrong(other.label, f"unknown key {key}; beside subtree there is only with")
        name = self._name(keys["subtree"], "subtree")
        values = self._wiring(keys["with"], "with") if "with" in keys else {}
        return SubtreeNode(value.place, name, values)

    def _wiring(self, value: Located, what: str) -> dict[str, Value]:
        if not isinstance(value.value, dict):
            self._wrong(value.place, f"{what} must be a mapping, not {value}")
            return {}
        return {port: self._wired(item) for port, item in value.value.items()}

    def _wired(self, value: Located) -> Value:
        if not isinstance(value.value, str) or not value.value.startswith("$"):
            return value
        name = Located(value.place, value.value[1:], value.label)
        return Key(value.place, self._name(name, "what follows $"), value.label)

    def _wrong(self, place: Place, message: str) -> None:
        self._mistakes.append(Mistake(place, message))


def _no_node(value: Located, keys: tuple[str, ...]) -> str:
    kinds = (*COMPOSITES, "subtree")
    if not keys:
        return f"a node is one of {', '.join(kinds)}, or a skill's name, not {value}"
    near = "".join(_meant(key, kinds) for key in keys)
    said = f"here are {', '.join(keys)}{near}"
    return f"a node has one key, {', '.join(kinds)}, or a skill's name; {said}"


def _keys(node: TreeNode) -> Iterator[str]:
    """The names of all values that a tree takes by name."""
    match node:
        case CompositeNode():
            for child in node.children:
                yield from _keys(child)
        case SkillNode():
            yield from (value.name for value in node.ports.values() if isinstance(value, Key))
        case SubtreeNode():
            yield from (value.name for value in node.values.values() if isinstance(value, Key))


def choices(word: str, known: Iterable[str]) -> str:
    """What there is, and what was probably meant."""
    names = sorted(known)
    return (", ".join(names) or "none") + _meant(word, names)


def _meant(word: str, known: Sequence[str]) -> str:
    near = get_close_matches(word, known, n=1)
    return f"; did you mean {near[0]}?" if near else ""
