"""Nodes: a located value in, the node it says out."""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import TypeGuard

from .document import Located, nested
from .errors import Mistake, Place
from .nodes import KINDS, ControlNode, Key, SkillNode, SubtreeNode, TreeNode, Value
from .values import choices, meant

MAX_NUMBER = 2**31 - 1

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_FILES = {"subtree": ("with", "name"), "task": ("with", "name")}
_HEADS = (*KINDS, *_FILES)


class Mistakes:
    """Collects what is wrong.

    Args:
        known: What is known to be wrong already; the same place is not told twice.
    """

    def __init__(self, known: Iterable[Mistake] = ()) -> None:
        self.found = list(known)
        self._told = {mistake.place for mistake in self.found}

    def add(self, place: Place, message: str) -> None:
        """Note a mistake."""
        if place not in self._told:
            self.found.append(Mistake(place, message))

    def add_last(self, place: Place, message: str) -> None:
        """Note a mistake after which nothing more can be said of that place."""
        self.add(place, message)
        self._told.add(place)


class NodeParser:
    """Reads nodes and names.

    Args:
        mistakes: Where to tell what is wrong.
    """

    def __init__(self, mistakes: Mistakes) -> None:
        self._wrong = mistakes.add

    def node(self, value: Located) -> TreeNode:
        """The node that a value says."""
        if isinstance(value.value, str):
            return SkillNode(value.place, self.name(value, "a node"), {})
        keys = nested(value)
        heads = [key for key in keys if key in _HEADS]
        if len(heads) == 1:
            (head,) = heads
            if head in _FILES:
                return self._file(value.place, head, keys)
            return self._control(value.place, head, keys)
        rest = [key for key in keys if key != "name"]
        if heads or len(rest) != 1:
            self._wrong(value.place, _no_node(value, tuple(keys)))
            return SkillNode(value.place, "", {})
        return self._skill(value.place, rest[0], keys)

    def is_name(self, value: object) -> TypeGuard[str]:
        """Whether something is a name."""
        return isinstance(value, str) and _NAME.fullmatch(value) is not None

    def name(self, value: Located, what: str) -> str:
        """A name; empty where it is none."""
        if self.is_name(value.value):
            return value.value
        rule = "a letter, then letters, digits, _ or -"
        self._wrong(value.place, f"{what}: {value} is not a name ({rule})")
        return ""

    def number(self, value: Located, what: str) -> int:
        """A task number; 0 where it is none."""
        number = value.value
        if type(number) is int and 0 <= number <= MAX_NUMBER:
            return number
        self._wrong(value.place, f"{what}: {value} is no number from 0 to {MAX_NUMBER}")
        return 0

    def line(self, value: Located, what: str) -> str:
        """A text as one line; empty where it is none."""
        if isinstance(value.value, str) and value.value.strip():
            return " ".join(value.value.split())
        self._wrong(value.place, f"{what}: {value} is not a text")
        return ""

    def wired(self, value: Located) -> Value:
        """A value that is written out, or `$name`."""
        if not isinstance(value.value, str) or not value.value.startswith("$"):
            return value
        if value.value.startswith("$$"):
            return Located(value.place, value.value[1:], value.label)
        name = Located(value.place, value.value[1:], value.label)
        return Key(value.place, self.name(name, "what follows $"), value.label)

    def _skill(self, place: Place, skill: str, keys: Mapping[str, Located]) -> SkillNode:
        inner = keys[skill]
        if isinstance(inner.value, list):
            lists = [kind for kind in KINDS if KINDS[kind].many]
            there = choices(skill, lists)
            self._wrong(inner.label, f"only {there} hold a list of nodes, not {skill}")
            return SkillNode(place, "", {})
        ports = self._wiring(inner, f"the ports of {skill}")
        shown = self._shown(keys)
        return SkillNode(place, "" if ports is None else skill, ports or {}, shown)

    def _control(self, place: Place, kind: str, keys: Mapping[str, Located]) -> ControlNode:
        known = KINDS[kind]
        beside = (*known.options, *filter(None, (known.condition,)), "name")
        self._beside(kind, keys, beside)
        children = self._children(kind, keys[kind])
        if known.condition:
            children += self._condition(place, kind, known.condition, keys)
        options = {key: self.wired(keys[key]) for key in known.options if key in keys}
        for option, declared in known.options.items():
            if declared.needed and option not in keys:
                self._wrong(place, f"{kind} needs {option}: {declared.description}")
        return ControlNode(place, kind, children, options, self._shown(keys))

    def _children(self, kind: str, inner: Located) -> tuple[TreeNode, ...]:
        if not KINDS[kind].many:
            return (self.node(inner),)
        if not isinstance(inner.value, list) or not inner.value:
            self._wrong(inner.place, f"{kind} needs a list of nodes, not {inner}")
            return ()
        return tuple(self.node(item) for item in inner.value)

    def _condition(
        self, place: Place, kind: str, key: str, keys: Mapping[str, Located]
    ) -> tuple[TreeNode, ...]:
        if key in keys:
            return (self.node(keys[key]),)
        self._wrong(place, f"{kind} needs {key}: the condition")
        return ()

    def _file(self, place: Place, head: str, keys: Mapping[str, Located]) -> SubtreeNode:
        self._beside(head, keys, _FILES[head])
        read: Callable[[Located, str], str | int] = self.number if head == "task" else self.name
        source = read(keys[head], head)
        values = self._wiring(keys["with"], "with") if "with" in keys else {}
        shown = self._shown(keys)
        return SubtreeNode(place, "" if values is None else source, values or {}, shown)

    def _beside(self, head: str, keys: Mapping[str, Located], known: tuple[str, ...]) -> None:
        for key, other in keys.items():
            if key != head and key not in known:
                there = choices(key, known)
                self._wrong(other.label, f"unknown key {key}; beside {head} there are {there}")

    def _shown(self, keys: Mapping[str, Located]) -> str:
        if "name" not in keys:
            return ""
        name = self.line(keys["name"], "name")
        if "/" in name or len(name) > 60:
            self._wrong(keys["name"].place, f"name: {name!r} has a / or more than 60 characters")
        return name

    def _wiring(self, value: Located, what: str) -> dict[str, Value] | None:
        """What ports are wired to; None where that is wrong as a whole."""
        if not isinstance(value.value, dict):
            named = value.value is not None and not isinstance(value.value, list)
            form = f"; say which, as in {{port: {value}}}" if named else ""
            self._wrong(value.place, f"{what} must be a mapping, not {value}{form}")
            return None
        return {port: self.wired(item) for port, item in value.value.items()}


def _no_node(value: Located, keys: tuple[str, ...]) -> str:
    if not keys:
        return f"a node is one of {', '.join(_HEADS)}, or a skill's name, not {value}"
    near = "".join(meant(key, _HEADS) for key in keys if key not in _HEADS)
    said = f"here are {', '.join(keys)}{near}"
    return f"a node has one key of {', '.join(_HEADS)}, or a skill's name; {said}"
