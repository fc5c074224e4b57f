"""The grammar of files: makes a task, a subtree or poses from a text, and finds mistakes.

The compiler checks the names of skills and ports, not this module.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from hardware.loading.dataclass import dataclass
from hardware.spelling import closest, corrections, did_you_mean
from trees.declarations import LIST, TYPES, UNITS, Declaration
from trees.errors import Correction, FileError, Mistake, Mistakes

from .document import Located, NotYaml, draft_document, names_within, nested, texts_within
from .lines import as_mapping, pieces, replaced_block
from .literals import fit, in_unit_of_default, measured
from .node_parser import NodeParser, respell
from .node_words import FILES, begins_node, holds_nodes, kinds, synonyms
from .repairs import repairing
from .specs import ControlNode, Key, SkillNode, SubtreeNode, TreeNode, Value

VERSION = 1  # version of the grammar

Read = TypeVar("Read")

_TASK_KEYS = (
    *("task", "name", "description", "parameters", "replaces", "retry", "grammar", "tree"),
)
_SUBTREE_KEYS = ("subtree", "description", "ports", "replaces", "grammar", "tree")
_POSES_KEYS = ("poses", "replaces", "grammar")
_OPTIONAL = ("parameters", "ports", "replaces", "retry", "grammar")
_DECLARED_KEYS = ("type", "default", "min", "max", "choices", "description")
_OTHER_KEYS = {"value": "default", "enum": "choices", "options": "choices"}  # other programs' keys
# Types by the names that programming languages and people use.
_OTHER_TYPES = {
    **dict.fromkeys(("float", "double", "real"), "number"),
    **dict.fromkeys(("degree", "degrees", "radian", "radians"), "angle"),
    **dict.fromkeys(("second", "seconds", "time"), "duration"),
    "int": "integer",
    "bool": "boolean",
    "str": "text",
    "string": "text",
}


@dataclass(frozen=True, slots=True)
class TaskFile:
    """A file with a tree: a numbered task, or a subtree that several tasks can use.

    Attributes:
        path: The file.
        text: Text of the file.
        number: Number of the task; None for a subtree.
        name: Name of the task or subtree, one word.
        description: Description, one line.
        parameters: Parameters of the task, or ports of the subtree, by name. A default is a
            Located. The type of an untyped port follows from its uses.
        replaces: Name of the shipped task or subtree that it replaces; empty for none.
        retry_safe: True if it may run again after a run with an unknown end (`retry: safe`).
        tree: Root of its tree.
    """

    path: Path
    text: str
    number: int | None
    name: str
    description: str
    parameters: Mapping[str, Declaration]
    replaces: str
    retry_safe: bool
    tree: TreeNode

    @property
    def port(self) -> str:
        """Word for a parameter of this file in messages: "parameter", or "port" for a subtree."""
        return "port" if self.number is None else "parameter"


Draft = tuple[TaskFile, list[Mistake]]  # the readable part of a file, and its mistakes


@dataclass(frozen=True, slots=True)
class PosesFile:
    """Poses by name.

    Attributes:
        path: The file.
        text: Text of the file.
        poses: Joint positions [rad] by joint name, by name of the pose. A wrong position is
            REFUSED. A wrong pose is missing.
        labels: Names and values of the poses with their places, by name.
        replaces: Names of the poses that replace shipped ones.
    """

    path: Path
    text: str
    poses: Mapping[str, Mapping[str, float]]
    labels: Mapping[str, Located]
    replaces: tuple[str, ...]


UNTYPED = ""  # type of a port whose type follows from its uses


def parse_task(path: Path, text: str) -> TaskFile:
    """Read a task file.

    Raises:
        FileError: The file has mistakes.
    """
    return _strict(*draft_task(path, text))


@repairing
def draft_task(path: Path, text: str) -> Draft:
    """Read a task file. Return the task and all mistakes.

    Raises:
        FileError: The file is not YAML.
    """
    return _draft(_Parser(path, text, _TASK_KEYS))


@repairing
def draft_subtree(path: Path, text: str) -> Draft:
    """Read a subtree file. Return the subtree and all mistakes.

    Raises:
        FileError: The file is not YAML.
    """
    return _draft(_Parser(path, text, _SUBTREE_KEYS))


def _draft(parser: "_Parser") -> Draft:
    file = replace(parser.head(), tree=parser.tree("tree"))
    parser.used(f"{file.port}s", file.tree)
    return file, parser.mistakes.found


def parse_head(path: Path, text: str) -> TaskFile:
    """Read a task file without its tree, in a fraction of the time.

    Raises:
        FileError: The file has mistakes.
    """
    head, _, tree = text.partition("\ntree:")
    follows = re.search(r"^[^\s#]", tree, re.MULTILINE) or not tree
    if follows or re.search(r"^\s*\{", head, re.MULTILINE):  # the tree may be inside braces
        return parse_task(path, text)
    with suppress(NotYaml):
        parser = _Parser(path, head, _TASK_KEYS)
        task = parser.head()
        if not parser.mistakes.found:
            return task
    return parse_task(path, text)  # the full parser reports the mistakes


@lru_cache(maxsize=16)  # every task needs the poses
@repairing
def draft_poses(path: Path, text: str) -> tuple[PosesFile, list[Mistake]]:
    """Read a file of poses. Return the poses and all mistakes.

    Raises:
        FileError: The file is not YAML.
    """
    parser = _Parser(path, text, _POSES_KEYS)
    given = parser.get("poses")
    given = given and (parser.by_name(given, "poses") or given)
    labels = nested(given) if given else {}
    wanted, wrong = Declaration("positions"), parser.mistakes.add
    if given and not isinstance(given.value, dict):
        wrong(given.place, f"poses: {given} is not a mapping of names to joint values")
    poses = {name: fit(value, wanted, {}, wrong) or {} for name, value in labels.items()}
    for name, value in labels.items():
        parser.nodes.name(Located(value.label, name, value.label), "a pose")
    replaced = parser.get("replaces", needed=False)
    names = replaced.value if replaced and isinstance(replaced.value, list) else []
    if replaced and not names:
        wrong(replaced.place, f"replaces: {replaced} is not a list of names of poses")
    replaces = tuple(parser.nodes.name(item, "replaces") for item in names)
    return PosesFile(path, text, poses, labels, replaces), parser.mistakes.found


def parse_value(text: str, source: str, location: str = "") -> Located:
    """Read a value that is not in a file, such as an argument of the command line.

    Args:
        text: The value in YAML.
        source: Name of its source, for errors.
        location: Location of the value in its source.

    Raises:
        FileError: The text is not YAML.
    """
    root, mistakes = draft_document(Path(source), text, location)
    return _strict(root, mistakes)


def _strict(read: Read, mistakes: list[Mistake]) -> Read:
    if mistakes:
        raise FileError(mistakes)
    return read


class _Parser:
    """Reads the top-level keys of a file, and collects mistakes."""

    def __init__(self, path: Path, text: str, keys: tuple[str, ...]) -> None:
        self._path, self._text, self._keys = path, text, keys
        self.root, known = draft_document(path, text)
        self.mistakes = Mistakes(known)
        self.nodes = NodeParser(self.mistakes)
        self._wrong = self.mistakes.add
        self._values = nested(self.root)
        if not self._values:
            needed = ", ".join(key for key in keys if key not in _OPTIONAL)
            hint = "; `armtree new` writes a task that runs" if keys is _TASK_KEYS else ""
            text = "\n".join(self.root.place.lines).rstrip()
            words = "|".join((*keys, *FILES, "with"))
            right = re.sub(rf"^([ -]*(?:{words}))(?= [^=]|$)", r"\1:", text, flags=re.MULTILINE)
            if isinstance(self.root.value, str) and right != text:
                why, row = f"a colon is missing after `{text.split()[0]}`", text.count("\n") + 1
                self.mistakes.add_last(self.root.place, why, Correction(right, 1, row))
            self._wrong(self.root.place, f"expected the keys {needed}{hint}")
        elif "tree" in keys and self._is_strange():
            why = f"this is not a task: it has neither {keys[0]} nor tree"
            self._wrong(self.root.place, f"{why}; `armtree new` writes a task that runs")
            self._values = {}
        self._values = self._corrections(self._with_tree(self._values, keys), keys)
        version = self.get("grammar", needed=False)
        if version and (type(version.value) is not int or version.value != VERSION):
            here = f"this armtree reads grammar {VERSION}"
            self._wrong(version.place, f"grammar: {version} is not supported; {here}")

    def _is_strange(self) -> bool:
        """Return True if no key belongs to a task or subtree, or to a node."""
        known = {*self._values, *corrections(self._values, self._keys).values()}
        if known & {self._keys[0], "tree", "with"}:
            return False
        return not any(begins_node(key) or holds_nodes(key) for key in self._values)

    def head(self) -> TaskFile:
        """Return the task or subtree without its tree."""
        task = "task" in self._keys
        return TaskFile(
            path=self._path,
            text=self._text,
            number=self.number("task") if task else None,
            name=self.name("name" if task else "subtree"),
            description=self.line("description"),
            parameters=self.declared("parameters" if task else "ports"),
            replaces=self.name("replaces", needed=False),
            retry_safe=self._retry_safe(),
            tree=SkillNode(self.root.place, "", {}),
        )

    def _retry_safe(self) -> bool:
        value = self.get("retry", needed=False)
        if value is not None and value.value != "safe":
            self._wrong(value.place, f"retry: {value} is not safe, the only value of this key")
        return value is not None

    def get(self, key: str, needed: bool = True) -> Located | None:
        value = self._values.get(key)
        if value is None and needed and self._values:
            place = replace(self.root.place, location=key)
            more = "; write the node that runs below it" if key == "tree" else ""
            self._wrong(place, f"the key {key} is missing{more}", self._line_for(key))
        return value

    def _named(self) -> dict[str, str]:
        """Return the task, name and subtree that the name of the file gives, by key."""
        path = self.root.place.path
        number, _, name = path.stem.partition("_")
        return {"task": number if number.isdecimal() else "", "name": name, "subtree": path.stem}

    def _line_for(self, key: str) -> Correction | None:
        """Return the correction that adds a missing key after the previous key, or None."""
        texts = {**self._named(), "description": "What it does."}
        if key == "tree" and not self.root.place.brackets:
            from skills import wait_node  # slow; only for a mistake

            lines = "\n".join(self.root.place.lines).rstrip().split("\n")
            return Correction(f"tree:\n  {wait_node('1 s')}", len(lines) + 1, 0)
        earlier = self._keys[: self._keys.index(key)]
        above = [self._values[each].label.line for each in earlier if each in self._values]
        if not texts.get(key) or self.root.place.brackets:
            return None
        first = min(value.label.line for value in self._values.values())
        return Correction(f"{key}: {texts[key]}", max(above) + 1 if above else first, 0)

    def _with_tree(
        self, values: Mapping[str, Located], known: tuple[str, ...]
    ) -> Mapping[str, Located]:
        """Report nodes outside the key `tree`, or poses outside `poses`. Move them below it."""
        head = "poses" if "poses" in known else "tree"
        likely = corrections(values, known)

        def is_below(key: str, value: Located) -> bool:
            if key in known or head == "poses":
                inside = isinstance(value.value, dict)
                return inside and (key not in known or key in kinds())
            listed = key in kinds() or _listed_kind(key, value)
            return bool(listed) or _in_node(key, value, likely)

        below = {key: value for key, value in values.items() if is_below(key, value)}
        rest = {key: value for key, value in values.items() if key not in below}
        first = next(iter(below), "")
        kind = _listed_kind(first, below[first]) if first else ""
        if head in values or not below or (corrections(rest, (head,)) and not kind):
            return values
        label = below[first].label
        why, right = f"{first} must be below the key {head}", self._below(head, below)
        if kind:
            why += f", as {kind}"
            right = right and replace(right, text=right.text.replace(first, kind, 1))
        self._wrong(label, why, right)
        inner = {kind if kind and key == first else key: each for key, each in below.items()}
        place = replace(label, location=head)
        return {**rest, head: Located(place, inner, place)}

    def _below(self, head: str, below: Mapping[str, Located]) -> Correction | None:
        """Return the lines of adjacent keys, indented below the new key `head`."""
        lines = self.root.place.lines
        begin = min(value.label.line for value in below.values())
        rest = [each for key, each in self._values.items() if key not in below]
        end = min((each.label.line for each in rest if each.label.line > begin), default=0)
        moved = [*lines[begin - 1 : end - 1 if end else len(lines)]]
        while not moved[-1].strip():
            moved.pop()
        if self.root.place.brackets or any(key not in " ".join(moved) for key in below):
            return None
        indented = [f"  {line}" if line.strip() else line for line in moved]
        return Correction("\n".join([f"{head}:", *indented]), begin, len(moved))

    def _corrections(
        self, values: Mapping[str, Located], known: tuple[str, ...]
    ) -> Mapping[str, Located]:
        """Report unknown keys. Return the values with corrected keys."""
        for key, other in (("ports", "parameters"), ("parameters", "ports")):
            if key in values and other in known and other not in values:
                why = f"a task has parameters, a subtree has ports: write {other}"
                self._wrong(values[key].label, why, values[key].label.replaced(key, other))
                values = respell(values, {key: other})
        likely = corrections(values, known)
        tree = values.get("tree") if "parameters" in known else None
        names = {*names_within(tree)} if tree else set()
        used = [key for key in values if key not in known and nested(values[key]).keys() & names]
        if len(used) == 1 and "parameters" not in values:
            likely |= {used[0]: "parameters"}
        for key, other in _OTHER_KEYS.items():
            if key in values and other in {*known} - {*values, *likely.values()}:
                likely[key] = other
        unknown = [key for key in values if key not in {*known, *likely}]
        needed = [key for key in known if key not in {*_OPTIONAL, *values, *likely.values()}]
        if "tree" in known and len(unknown) == len(needed) == 1:
            likely[unknown[0]] = needed[0]
        return self.nodes.known_keys(values, known, likely)

    def number(self, key: str) -> int:
        value = self.get(key)
        return self.nodes.number(value, key, self._named()[key]) if value else 0

    def name(self, key: str, needed: bool = True) -> str:
        value = self.get(key, needed)
        return self.nodes.name(value, key, self._named().get(key, "")) if value else ""

    def line(self, key: str) -> str:
        value = self.get(key)
        return self.nodes.line(value, key) if value else ""

    def tree(self, key: str) -> TreeNode:
        value = self.get(key)
        return self.nodes.node(value) if value else SkillNode(self.root.place, "", {})

    def declared(self, key: str) -> dict[str, Declaration]:
        """Return the parameters or ports that a key declares, by name."""
        value = self.get(key, needed=False)
        if value is None:
            return {}
        if isinstance(value.value, list) and key == "ports":
            return {name: Declaration(UNTYPED) for name in self._names(value, key)}
        if mapping := self.by_name(value, key):
            value = mapping
        if parts := pieces(value):
            why = f"{key}: {value} is not a mapping, but a list: leave out each `-`"
            self._wrong(value.place, why, as_mapping(value))
            value = replace(value, value={k: v for i in parts for k, v in nested(i).items()})
        if not isinstance(value.value, dict):
            more = ", or a list of names" if key == "ports" else ""
            self._wrong(value.place, f"{key}: {value} is not a mapping of names to types{more}")
            return {}
        declared, known = {}, _DECLARED_KEYS + ("output",) * (key == "ports")
        for name, item in value.value.items():
            self.nodes.name(Located(item.label, name, item.label), key)
            declared[name.lstrip("$")] = self._declaration(item, f"{key}: {name}", known)
        return declared

    def by_name(self, value: Located, key: str) -> Located | None:
        """Report a list of mappings with the key `name`. Return a mapping by name, or None."""
        items = value.value if isinstance(value.value, list) else []
        names = [str(nested(item)["name"].value) for item in items if "name" in nested(item)]
        if not names or len({*names}) != len(items):
            return None
        rests = [{k: v for k, v in nested(item).items() if k != "name"} for item in items]
        found = {
            name: replace(v, value=rest) for name, v, rest in zip(names, items, rests, strict=True)
        }
        if key == "poses" and all(len(rest) == 1 for rest in rests):
            found = {name: next(iter(nested(each).values())) for name, each in found.items()}
        indent = "  " * (value.place.column == value.label.column)
        rows = [f"{indent}{name}: {each.as_yaml()}" for name, each in found.items()]
        why = f"{key}: a list is not a mapping of names; write each name as a key"
        self._wrong(value.place, why, replaced_block(value.place, rows))
        return replace(value, value=found)

    def used(self, key: str, tree: TreeNode) -> None:
        """Report declared names that the tree does not use."""
        value, names = self._values.get(key), {*self.nodes.spare}
        texts = dict[object, Located]()
        for used in _values(tree):
            if isinstance(used, Key):
                names.add(used.name)
            else:
                texts |= {re.sub(r"\W", "", str(text.value)): text for text in texts_within(used)}
                # A text without $ is not a reference.
                names |= set() if isinstance(used.value, str) else {*names_within(used)}
        if value is None or tree == SkillNode(tree.place, "", {}):
            return
        items = value.value if isinstance(value.value, list) and key == "ports" else []
        places = {each.value: each.place for each in items if isinstance(each.value, str)}
        places |= {name: item.label for name, item in nested(value).items()}
        for name, place in places.items():
            if name not in names and name in texts:
                text = texts[name]
                what = f"the value of the {key[:-1]} {name}"
                why = f"{text} is only a text; for {what}, write ${name}"
                right = text.instead(f"${name}")
                if str(text.value).startswith("-"):
                    right, why = None, f"{why}; it cannot be negated: declare another {key[:-1]}"
                self.mistakes.add_last(text.place, why, right)
            elif name not in names and self.nodes.is_name(name):
                self._wrong(place, f"{key}: nothing in the tree uses ${name}")

    def _names(self, value: Located, key: str) -> list[str]:
        names: list[str] = []
        for item in value.value if isinstance(value.value, list) else []:
            name = self.nodes.name(item, key)
            if name in names:
                self._wrong(item.place, f"{key}: {name} is given twice")
            names += [name] if name else []
        return names

    def _declaration(self, value: Located, what: str, known: tuple[str, ...]) -> Declaration:
        texts = [*texts_within(value)] if isinstance(value.value, list) else []
        if kind := "text" if texts else _type_of(value):
            default = texts[0] if texts else value
            choices = f"choices: {value.as_yaml()}, " if texts else ""
            typed = f"{{type: {kind}, {choices}default: {default.as_yaml()}}}"
            why = f"{what} needs a type, and {value} is a value: write {typed}"
            self._wrong(value.place, why, value.instead(typed))
            return Declaration(kind, default=default)
        if isinstance(value.value, str):
            return Declaration(self._type(value, what, "output" in known))
        keys = self._corrections(nested(value), known)
        kind, output = UNTYPED, self._flag(keys.get("output"))
        if "type" in keys:
            likely = measured(keys["default"]) if "default" in keys else ""
            kind = self._type(keys["type"], what, "output" in known, likely)
        else:
            kind = _type_of(keys["default"]) if "default" in keys else ""
            old, near = value.place.brackets, f"type: {kind or 'number'}"
            right = value.place.replaced(old, f"{{{near}, {old[1:]}") if kind and old else None
            there = _types() + did_you_mean(near if kind else "")
            self._wrong(value.place, f"{what} needs a type: {there}", right)
        if "default" in keys and output:
            self._wrong(keys["default"].label, f"{what} is an output, and outputs have no default")
        given = keys.get("default")
        least, most = (self._bound(kind, keys.get(key), key, given) for key in ("min", "max"))
        if least is not None and most is not None and most < least:
            self._wrong(keys["max"].place, f"{what}: max is less than min")
        return Declaration(
            UNTYPED if output is None else kind,
            default=self._default(keys.get("default"), what),
            least=least,
            most=most,
            choices=self._choices(kind, keys.get("choices")),
            output=output is True,
            description=self.nodes.line(keys["description"], what) if "description" in keys else "",
        )

    def _type(self, value: Located, what: str, opaque: bool, likely: str = "") -> str:
        """Return a type. If `opaque`, accept types that only skills can write, such as Plan.

        A message suggests the type `likely` if it is not empty.
        """
        kind = value.value
        if isinstance(kind, str) and (kind in TYPES or (opaque and kind[:1].isupper())):
            return kind
        units = (each for each, names in UNITS.items() if str(kind) in names)
        near = likely or _OTHER_TYPES.get(str(kind)) or next(units, closest(str(kind), TYPES))
        why = f"{what}: no type {kind}; there are {_types()}{did_you_mean(near)}"
        self._wrong(value.place, why, value.instead(near))
        return UNTYPED

    def _default(self, value: Located | None, what: str) -> Located | None:
        wired = value and self.nodes.wired(value)
        if isinstance(wired, Key):
            hint = "for a text that begins with a $, write $$"
            self._wrong(
                wired.place, f"{what}: a default is a value, not the reference {value}; {hint}"
            )
            return None
        return wired

    def _bound(self, kind: str, value: Located | None, key: str, default: Located | None) -> Any:
        if value is None:
            return None
        if default and (near := in_unit_of_default(value, default, key)):
            unit = next(iter(UNITS[measured(default)]))  # the type may be wrong
            why = f"{key}: {value} without a unit is {value} {unit}{did_you_mean(near)}"
            self._wrong(value.place, why, value.instead(near))
            value = replace(value, value=near)
        inner = kind.removeprefix(LIST)
        if inner in ("text", "boolean", "positions"):
            self._wrong(value.label, f"a {inner} has no min and no max")
            return None
        return fit(value, Declaration(inner), {}, self._wrong) if kind else None

    def _choices(self, kind: str, value: Located | None) -> tuple[str, ...]:
        if value is None:
            return ()
        items = value.value if isinstance(value.value, list) else []
        texts = [item for item in items if isinstance(item.value, str)]
        if kind and (kind.removeprefix(LIST) != "text" or not texts or texts != items):
            self._wrong(value.label, "choices must be a list of texts, and the type must be text")
        for number, item in enumerate(items):
            if item.value in [other.value for other in items[:number]]:
                self._wrong(item.place, f"choices: {item} is given twice")
        return tuple(str(item.value) for item in items)

    def _flag(self, value: Located | None) -> bool | None:
        """Return a boolean; False for a missing value; None if the value is not a boolean."""
        if value is None or isinstance(value.value, bool):
            return value is not None and value.value is True
        self._wrong(value.place, f"{value} is not true or false")
        return None


def _types() -> str:
    plain = [each for each in TYPES if not each.startswith(LIST)]
    return f"{', '.join(plain)}, and a list of one of these"


def _type_of(value: Located) -> str:
    """Return the type of a number, a quantity or a boolean; else an empty text."""
    kinds = {int: "integer", float: "number", bool: "boolean"}
    return measured(value) or kinds.get(type(value.value), "")


def _in_node(key: str, value: Located, likely: Mapping[str, str]) -> bool:
    """Return True if a key most likely belongs to a node. `likely` has corrections of keys."""
    if key in ("subtree", "with"):
        return True
    return key not in likely and (begins_node(key) or value.value is None)


def _listed_kind(key: str, value: Located) -> str:
    """Return the kind of control node that a key above a list means, or ""."""
    return synonyms().get(key, "") if isinstance(value.value, list) else ""


def _values(node: TreeNode) -> Iterator[Value]:
    match node:
        case ControlNode():
            for child in node.children:
                yield from _values(child)
            yield from node.options.values()
        case SkillNode():
            yield from node.ports.values()
        case SubtreeNode():
            yield from node.values.values()
