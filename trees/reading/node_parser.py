"""Reading of nodes: makes the nodes of a tree from YAML values."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeGuard

from hardware.spelling import corrections, did_you_mean, there_are
from trees.errors import Correction, Mistakes, Place

from .corrected_nodes import apart, comparison, node_instead, twice
from .document import (
    REFUSED,
    Located,
    calculates,
    names_within,
    nested,
    no_calculation,
    reference,
)
from .foreign_loops import EXAMPLES, is_amount, read_loop
from .lines import added_below, as_mapping, block, key_block, replaced_block, rewritten
from .literals import measured, renamed
from .node_words import (
    FILES,
    begins_node,
    beside_keys,
    heads,
    holds_nodes,
    in_turn,
    keywords,
    kinds,
    likely_heads,
    synonyms,
)
from .specs import ControlNode, Key, SkillNode, SubtreeNode, TreeNode, Value

MAX_NUMBER = 2**31 - 1
_NODE = "a node"  # users cannot choose the name of a skill

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_WORDS = re.compile(r"[A-Za-z]+( [A-Za-z]+)+")
_PATH = re.compile(r"[\w./\\-]*[/\\][\w.-]+")
# Words of other programs for the key `with`.
_WITH = ("args", "arguments", "params", "parameters", "ports", "inputs", "input", "values")


def joined(words: str) -> str:
    """Return a name made of words, such as `my_task`; empty if they make no name."""
    name = "_".join(words.split())
    return name if NAME.fullmatch(name) else ""


class NodeParser:
    """Reads nodes and names. A misspelt name is reported, and then treated as the suggestion.

    Args:
        mistakes: Receives mistakes.

    Attributes:
        spare: Names of references in wrong values. These names count as used.
    """

    def __init__(self, mistakes: Mistakes) -> None:
        self._mistakes, self._wrong = mistakes, mistakes.add
        self.spare: set[str] = set()

    def node(self, value: Located) -> TreeNode:
        """Return the node that a value describes."""
        if isinstance(value.value, str):
            if node := comparison(value):
                why = f"a node compares values: write {node}"
                self._wrong(value.place, why, value.instead(node))
                return self._unknown(value)
            # Two words may be parts of one name.
            words = value.value if _WORDS.fullmatch(value.value) else self.name(value, _NODE)
            return SkillNode(value.place, words, {})
        if found := twice(value, in_turn()):
            there, right = found
            self._mistakes.withdraw(there)
            why = f"begin each node of a list with a `-`, below {in_turn()}:"
            self._wrong(there, why, right)
            return self._broken(value, nested(value))
        keys = self._in_other_words(value, self._in_lower_case(nested(value)))
        begun = [key for key in keys if key in heads()]
        rest = [key for key in keys if key != "name"]
        if loop := read_loop(value.place, keys):
            self._wrong(loop.place, loop.why, loop.right)
            return self._headed(value.place, loop.kind, loop.keys)
        skills = [key for key in rest if key[:1].isupper() or key in keywords()]
        if len(begun) == 1 and begun[0] in FILES and skills:
            nodes = {in_turn(): [*map(_as_item, apart(keys))]}
            alone = not value.place.location.endswith("]")  # in a list, a `-` is missing
            named = begun[0] == rest[0] and skills[0] not in keywords()
            right = rewritten(value.place, nodes) if alone and named else None
            right = right or node_instead(value, in_turn())
            self._wrong(keys[skills[0]].label, _no_node(value, tuple(keys)), right)
            return self._broken(value, keys)
        if len(begun) == 1:
            return self._headed(value.place, begun[0], keys)
        if not begun and len(rest) == 1 and rest[0] not in beside_keys():
            return self._skill(value.place, rest[0], keys)
        skilled = [key for key in rest if begins_node(key)]
        if len(skilled) == 1 and skilled[0][:1].isupper() and not any(map(holds_nodes, rest)):
            beside = {key: keys[key] for key in keys if key != skilled[0]}
            beside = self.known_keys(beside, ("name",), {}, f"beside {skilled[0]} ")
            return self._skill(value.place, skilled[0], {skilled[0]: keys[skilled[0]], **beside})
        likely = {} if begun else likely_heads(rest)
        if len(likely) == 1:
            ((word, head),) = likely.items()
            instead = keys[word].label.replaced(word, head)
            self._wrong(value.place, _no_node(value, tuple(keys)), instead)
            return self._headed(value.place, head, respell(keys, likely))
        instead = node_instead(value, in_turn())
        self._wrong(value.place, _no_node(value, tuple(keys)), instead)
        return self._broken(value, keys)

    def _in_lower_case(self, keys: Mapping[str, Located]) -> Mapping[str, Located]:
        """Report keys such as `Subtree` and `With`. Return the values with the correct keys.

        The name of a control node is corrected if the node has an option of this kind.
        """
        known = {*FILES, *(each for beside in FILES.values() for each in beside)}
        known |= {name for name, kind in kinds().items() if keys.keys() & kind.options.keys()}
        likely = {key: key.lower() for key in keys if key not in known and key.lower() in known}
        for key, near in likely.items():
            label = keys[key].label
            self._wrong(label, f"no key {key}{did_you_mean(near)}", label.replaced(key, near))
        return respell(keys, likely)

    def _in_other_words(self, value: Located, keys: Mapping[str, Located]) -> Mapping[str, Located]:
        """Report keys that only describe a node, such as its kind. Return correct values."""
        place, given = value.place, {key: each for key, each in keys.items() if key != "name"}
        lists = [each for each in given.values() if isinstance(each.value, list)]
        named = [f"{each.value}" for each in given.values() if f"{each.value}" in kinds()]
        if len(given) == 2 and len(lists) == len(named) == 1 and not given.keys() & {*heads()}:
            below, (kind,) = key_block(lists[0].label)[1:], named
            right = replaced_block(place, [f"{kind}:", *below]) if below else None
            why = f"write the kind of a node as the key above its nodes: {kind}:"
            self._wrong(place, why, right)
            return {kind: lists[0]}
        own = {*heads(), *beside_keys(), *keywords(), *synonyms()} - {"with"}
        rest = {key: each for key, each in given.items() if key not in own}
        lower = {key: each for key, each in rest.items() if not key[:1].isupper()}
        values = next((key for key, each in lower.items() if _are_values(each)), "")
        if len(rest) != 2 or len(given) != 2 or not values:
            return keys
        (head,) = rest.keys() - {values}
        if not head[:1].isupper() and self.is_name(given[head].value):
            for key, near, other in (head, "subtree", values), (values, "with", head):
                if key != near:
                    label, why = given[key].label, f"no key {key} beside {other}"
                    self._wrong(label, why + did_you_mean(near), label.replaced(key, near))
            return respell(keys, {head: "subtree", values: "with"})
        if head[:1].isupper() and given[head].value is None and values == "with":
            node = f"{head}: {given['with'].as_yaml()}"
            why = f"the ports of a skill follow its name: write {node}"
            self._wrong(given["with"].label, why, replaced_block(place, [node]))
            return {head: given["with"]}
        return keys

    def _headed(self, place: Place, head: str, keys: Mapping[str, Located]) -> TreeNode:
        made = self._file if head in FILES else self._control
        return made(place, head, keys)

    def _broken(self, value: Located, keys: Mapping[str, Located]) -> TreeNode:
        """Return a node of unknown kind, with the nodes that are recognised in the value."""
        items = value.value if isinstance(value.value, list) else ()
        below: list[TreeNode] = [self._unknown(value), *self._items(items)]
        beside = {*beside_keys(), *keywords()}
        for key, item in keys.items():
            if key in kinds():
                below += self._children(key, item)
            elif key in FILES:
                own = {key, "with"} if len(FILES.keys() & keys.keys()) == 1 else {key}
                mine = {name: each for name, each in keys.items() if name in own}
                below.append(self._file(value.place, key, mine))
            elif key not in beside and isinstance(item.value, dict):
                below.append(self._skill(value.place, key, {key: item}))
        return ControlNode(value.place, "", tuple(below)) if below[1:] else below[0]

    def _unknown(self, value: Located) -> SkillNode:
        """Return a leaf of an unknown skill, with the references in the value."""
        keys = {name: Key(value.place, name, value.label) for name in names_within(value)}
        return SkillNode(value.place, "", keys)

    def is_name(self, value: object) -> TypeGuard[str]:
        """Return True if a value is a name."""
        return isinstance(value, str) and NAME.fullmatch(value) is not None

    def name(self, value: Located, what: str, named: str = "") -> str:
        """Return a name. If the value is wrong, return `named`, or a likely name, or ""."""
        if self.is_name(value.value):
            return value.value
        why = f"{what}: {value} is not a name (a letter, then letters, digits, _ or -)"
        if self.is_name(named):
            return self._as_named(value, what, why, named)
        stem = str(value.value or "").partition(" //")[0].rstrip()
        stem = stem.removesuffix(".yaml").lstrip("$")
        near = stem if self.is_name(stem) or what == _NODE else joined(stem)
        near = near if self.is_name(near) else ""
        right = value.instead(near)
        if what == "name" and near != stem:
            right = None  # the file must be renamed, too
        self._wrong(value.place, f"{why}{did_you_mean(near)}", right)
        return near

    def number(self, value: Located, what: str, named: str = "") -> int:
        """Return a task number. If the value is wrong, return a likely number, or `named`, or 0."""
        if is_number(value.value):
            return value.value
        text = value.value if isinstance(value.value, str) else ""
        why = f"{what}: {value} is not a number from 0 to {MAX_NUMBER}"
        if text.isdecimal():
            why = f"{what}: {value} is a text; leave out the quotes"
            self._wrong(value.place, why, value.instead(text))
            return int(text) if is_number(int(text)) else 0
        if found := re.fullmatch(r"(\d+)_[\w-]+(\.ya?ml)?", text):
            self._wrong(value.place, f"{why}{did_you_mean(found[1])}", value.instead(found[1]))
            return int(found[1])
        if named:
            why += "; write the number at the key task, the name at the key name" if text else ""
            return int(self._as_named(value, what, why, named))
        if self.is_name(text):
            why += "; write the number of its file, such as 1 for 1_pick.yaml"
        self._wrong(value.place, why)
        return 0

    def _as_named(self, value: Located, key: str, why: str, named: str) -> str:
        """Report a wrong value. Return `named`, the value that the name of the file gives."""
        right = None
        if re.fullmatch(r"[\w\s.-]*", str(value.value)):
            why += f"; the name of the file gives {named}"
            right = value.instead(named) or value.label.replaced(f"{key}:", f"{key}: {named}")
        self._wrong(value.place, why, right)
        return named

    def line(self, value: Located, what: str) -> str:
        """Return a text as one line; empty if the value is not a text."""
        if isinstance(value.value, str) and value.value.strip():
            return " ".join(value.value.split())
        why = "write a text here" if value.value is None else f"{value} is not a text"
        near = f"{what}: What it does." if value.value is None else ""
        self._wrong(value.place, f"{what}: {why}", value.label.replaced(f"{what}:", near))
        return ""

    def wired(self, value: Located) -> Value:
        """Return a literal value, or a reference for `$name`."""
        if not isinstance(value.value, str) or not value.value.startswith("$"):
            return value
        if value.value.startswith("$$"):
            return Located(value.place, value.value[1:], value.label)
        if calculates(value.value):
            self._wrong(value.place, no_calculation(value.value))
            self.spare |= {*names_within(value)}
            return replace(value, value=REFUSED)
        if meant := reference(value.value):
            self._wrong(value.place, f"write {meant}, not {value.value}", value.instead(meant))
        name = Located(value.place, (meant or value.value)[1:], value.label)
        return Key(value.place, self.name(name, "the name after $"), value.label)

    def _skill(self, place: Place, skill: str, keys: Mapping[str, Located]) -> TreeNode:
        inner = keys[skill]
        around = {key: each for key, each in nested(inner).items() if key not in ("ID", "name")}
        if len(around) == 1 and any(map(holds_nodes, around)):
            right = replaced_block(place, key_block(next(iter(around.values())).label) or [skill])
            self._wrong(place, f"no node {skill}; leave it out, but keep the node below it", right)
            return self.node(replace(inner, value=around))
        if isinstance(inner.value, list) and self._are_nodes(skill, inner.value):
            lists = [name for name, kind in kinds().items() if kind.many]
            kind = corrections((skill,), lists).get(skill, "") or synonyms().get(skill, "")
            there = ", ".join(lists) + did_you_mean(kind)
            why = f"{skill} takes no list of nodes; these do: {there}"
            self._wrong(inner.label, why, inner.label.replaced(skill, kind))
            if not kind and all(isinstance(item.value, str) for item in inner.value):
                return self._unknown(inner)
            return ControlNode(place, kind, self._items(inner.value))
        text = str(inner.value)
        if text.startswith("$") and " " in text and (node := comparison(inner)):
            right = inner.label.replaced(f"{skill}: {inner.value}", node[1:-1])
            self._wrong(inner.place, f"a node compares values: write {node}", right)
            return self._unknown(inner)
        # Two words may be parts of one name.
        label = Located(inner.label, skill, inner.label)
        name = skill if _WORDS.fullmatch(skill) else self.name(label, _NODE)
        return SkillNode(place, name, self._wiring(inner), self._shown(keys))

    def _are_nodes(self, key: str, items: Sequence[Located]) -> bool:
        """Return True if a list below a key may have nodes, not values at ports."""
        named = key[:1].isupper() or likely_heads((key,)) or key in synonyms()
        nodes = any(any(map(begins_node, nested(item))) for item in items)
        return not any(map(is_amount, items)) and bool(named or nodes)

    def _control(self, place: Place, kind: str, keys: Mapping[str, Located]) -> ControlNode:
        known = kinds()[kind]
        beside = (*known.options, *filter(None, (known.condition,)), "name")
        keys = self._beside(kind, self._raised(place, kind, keys, beside), beside)
        children = self._children(kind, keys[kind])
        if known.condition:
            children += self._condition(place, kind, known.condition, keys)
        options = {key: self.wired(keys[key]) for key in known.options if key in keys}
        for option, declared in known.options.items():
            if declared.needed and option not in keys:
                example = EXAMPLES.get(declared.type, "…")
                why = f"{kind} needs {option}: {declared.description}; write it below, in the"
                right = added_below(place, f"{option}: {example}")
                self._wrong(place, f"{why} column of {kind}", right)
        return ControlNode(place, kind, children, options, self._shown(keys))

    def _raised(
        self, place: Place, kind: str, keys: Mapping[str, Located], own: Collection[str]
    ) -> Mapping[str, Located]:
        """Report options below a control node that belong to its level. Return corrected values."""
        inner = nested(keys[kind])
        inside = [key for key in inner if key in kinds()]
        theirs = {"name", *(option for head in inside for option in kinds()[head].options)}
        lost = {key: inner[key] for key in inner if key in own and key not in {*theirs, *keys}}
        left = {key: value for key, value in inner.items() if key not in lost}
        made = {**keys, kind: replace(keys[kind], value=left), **lost}
        for key, value in lost.items():
            row, lines = value.label.line - place.line, block(place)
            right = None
            if keys[kind].place.brackets:
                right = rewritten(place, {name: each.as_yaml() for name, each in made.items()})
            elif row > 0 and len(key_block(value.label)) == 1:
                kept = [*lines[:row], *lines[row + 1 :]]
                right = replaced_block(place, [*kept, f"{key}: {value.as_yaml()}"])
            why = f"{key} belongs to {kind}: write it at the level of {kind}"
            self._wrong(value.label, why, right)
        return made if lost else keys

    def _children(self, kind: str, inner: Located) -> tuple[TreeNode, ...]:
        if kinds()[kind].only_asks and is_amount(inner):
            from skills import wait_node  # slow; only for a mistake

            wait = wait_node(inner.as_yaml())
            why = f"{kind} takes a condition; to wait for some time, write {wait}"
            right = inner.label.replaced(f"{kind}: {inner.as_yaml()}", wait)
            self._wrong(inner.place, why, right)
            return (SkillNode(inner.place, "", {}),)
        if not kinds()[kind].many:
            return (self.node(inner),)
        if isinstance(inner.value, list) and inner.value:
            return self._items(inner.value)
        given = "" if inner.value is None or inner.value == [] else f", not {inner}"
        why = f"{kind} needs a list of nodes{given}: begin each node with a `-`, below {kind}:"
        parts, right = apart(nested(inner)), None
        unknown = not any(begins_node(key) for part in parts for key in part)
        nodes = [*map(_named_node, parts)]
        if len(parts) == 1 and parts[0].keys() - beside_keys():
            nodes = [nodes[0] or parts[0]]  # its name is misspelt
        elif parts and unknown and not any(nodes):
            nodes = [*parts]  # names of subtrees, or misspelt
        if len(parts) == 1 and all(nodes) and inner.place.brackets:
            right = inner.instead(f"[{inner.place.brackets}]")
        elif parts and all(nodes) and inner.place.brackets:
            right = inner.instead(f"[{', '.join(map(as_node, nodes))}]")
        elif nodes and all(nodes) and (unknown or nodes != parts):  # else, the lines lack a `-`
            right = replaced_block(inner.place, [f"- {_as_item(node)}" for node in nodes])
        self._wrong(inner.place, why, right)
        if not nodes or not all(nodes):
            return (self._broken(inner, nested(inner)),)
        return self._items([Located(inner.place, node, inner.label) for node in nodes])

    def _items(self, items: Iterable[Located]) -> tuple[TreeNode, ...]:
        return tuple(self.node(item) for item in items)

    def _condition(
        self, place: Place, kind: str, key: str, keys: Mapping[str, Located]
    ) -> tuple[TreeNode, ...]:
        given = keys.get(key)
        if given and not isinstance(given.value, bool):
            return (self.node(given),)
        from skills import EXAMPLE_CONDITION  # slow; only for a mistake

        right, why = added_below(place, f"{key}: {EXAMPLE_CONDITION}"), "a condition"
        if given:
            right = given.instead(EXAMPLE_CONDITION)
            why += f", not {given}"
        why = f"{kind} needs the key {key} with {why}"
        self._wrong(given.place if given else place, why, right)
        return ()

    def _file(self, place: Place, head: str, keys: Mapping[str, Located]) -> TreeNode:
        if head == "subtree" and is_number(number := keys[head].value):
            why = f"a subtree has a name; a task has a number: write task: {number}"
            self._wrong(keys[head].label, why, keys[head].label.replaced(head, "task"))
            keys, head = respell(keys, {head: "task"}), "task"
        if isinstance(items := keys[head].value, list) and items:
            why = f"a node runs one {head}; write one node for each, below {in_turn()}:"
            nodes = [as_node({**keys, head: item}) for item in items]
            right = rewritten(place, {in_turn(): nodes})
            if not items[1:]:
                why = f"{head}: write the name without brackets"
                right = keys[head].instead(items[0].as_yaml())
            self._wrong(keys[head].place, why, right)
            keys = {**keys, head: items[0]}
        keys = self._named(place, head, keys)
        keys = self._beside(head, self._with(head, keys), FILES[head])
        source: str | int
        if head == "task":
            given = keys[head]
            number = 0 if self.is_name(given.value) else self.number(given, head)
            source = given.value if self.is_name(given.value) else ""
            source = number if is_number(given.value) else source
        elif _PATH.fullmatch(str(keys[head].value)):
            source = str(keys[head].value)  # the compiler knows the files
        else:
            source = self.name(keys[head], head)
        values = self._wiring(keys["with"]) if "with" in keys else {}
        return SubtreeNode(place, source, values, self._shown(keys), keys[head], head)

    def _named(self, place: Place, head: str, keys: Mapping[str, Located]) -> Mapping[str, Located]:
        """Report a mapping that is written in place of a name. Return corrected values."""
        inner = nested(keys[head])
        names = [key for key, each in inner.items() if isinstance(each.value, str)]
        if len(names) != 1 or not self.is_name(inner[names[0]].value):
            return keys
        rest = {key: each for key, each in inner.items() if key != names[0]}
        values = Located(keys[head].place, rest, keys[head].label)
        made = {**keys, head: inner[names[0]], **({"with": values} if rest else {})}
        right = rewritten(place, {key: each.as_yaml() for key, each in made.items()})
        self._wrong(keys[head].place, f"write the name after {head}:, without {names[0]}", right)
        return made

    def _with(self, head: str, keys: Mapping[str, Located]) -> Mapping[str, Located]:
        """Report ports at the level of `subtree` or `task`. Return values with the key `with`."""
        known = (head, *FILES[head])
        ports = {key: value for key, value in keys.items() if key not in known}
        titles = [key for key, each in ports.items() if _is_title(each)]
        ports = {key: each for key, each in ports.items() if key not in titles}
        given = [keys["with"]] if "with" in keys else []
        words = [key for key in ports if key in _WITH and nested(ports[key])]
        if len(ports) == 1 and words and not given:
            label = ports[words[0]].label
            why = f"write the values at ports below the key with, not {words[0]}"
            self._wrong(label, why, label.replaced(words[0], "with"))
            return respell(keys, {words[0]: "with"})
        # A number belongs to a port, such as `width: 20 mm`.
        likely = corrections(keys, known).items()
        if any(near != "with" or not is_amount(keys[key]) for key, near in likely):
            return keys
        other = {key for key in ports if given and (key in beside_keys() or begins_node(key))}
        ports = {key: each for key, each in ports.items() if key not in other}
        if not ports or not all(isinstance(each.value, dict) for each in given):
            return keys
        what = "parameters of a task" if head == "task" else "ports of a subtree"
        why = f"write the {what} below the key `with`"
        if given:
            why = f"{', '.join(ports)} must be below the key with, like the other ports"
        inside = {key: each for values in map(nested, given) for key, each in values.items()}
        moved = [*given, *ports.values()]
        first = moved[0].label
        inner = Located(given[0].place if given else first, {**inside, **ports}, first)
        ends = [each.label.line + len(key_block(each.label)) for each in moved]
        adjacent = [each.label.line for each in moved[1:]] == ends[:-1] and ends[-1] > first.line
        right = None
        if adjacent and (not given or ends[0] == first.line + 1):  # else, a line is not indented
            begin = first.lines[first.line - 1][: first.column - 1]
            line = f"{begin}with: {inner.as_yaml()}"
            right = Correction(line, first.line, ends[-1] - first.line)
        self._wrong(next(iter(ports.values())).label, why, right)
        return {**{key: each for key, each in keys.items() if key not in ports}, "with": inner}

    def _beside(
        self, head: str, keys: Mapping[str, Located], known: tuple[str, ...]
    ) -> Mapping[str, Located]:
        """Report unknown keys of a node. Return the values by corrected keys."""
        beside = {key: each for key, each in keys.items() if key != head}
        likely = corrections(beside, known)
        likely |= _other_option(head, respell(keys, likely))
        titles = [key for key, each in beside.items() if _is_title(each)]
        if len(titles) == 1 and not {"name", *titles} & {*known}.intersection(beside):
            likely |= {titles[0]: "name"}
        others = {} if head in FILES else kinds()[head].other_options
        likely |= {key: near for key, near in others.items() if key in beside and near not in keys}
        return {head: keys[head], **self.known_keys(beside, known, likely, f"beside {head} ")}

    def known_keys(
        self,
        keys: Mapping[str, Located],
        known: Collection[str],
        likely: Mapping[str, str],
        where: str = "",
    ) -> dict[str, Located]:
        """Report unknown keys. Return the values by likely keys."""
        for key in (key for key in keys if key not in known):
            there, label = there_are(key, known, keys), keys[key].label
            near = likely.get(key, "")
            if near:
                there = there.partition(";")[0] + did_you_mean(near)
            else:
                there += "; it belongs in poses.yaml" if key == "poses" else "; leave it out"
            why = f"unknown key {key}; {where}{there}"
            self.spare |= {*names_within(keys[key])}
            value, right = renamed(key, near, keys[key])
            keys = {**keys, key: value} if near else keys
            self._wrong(label, why, right)
        return respell(keys, likely)

    def _shown(self, keys: Mapping[str, Located]) -> str:
        if "name" not in keys:
            return ""
        name = self.line(keys["name"], "name")
        if "/" in name or len(name) > 60:
            self._wrong(keys["name"].place, f"name: {name!r} has a / or more than 60 characters")
        return name

    def _wiring(self, value: Located) -> dict[str, Value]:
        """Return the values at ports. A value that is not a mapping is at the port ""."""
        items = value.value if isinstance(value.value, list) else []
        if items and all(isinstance(item.value, dict) for item in items):
            how = "write braces" if value.place.brackets else "leave out each `-`"
            why = f"the ports of a node are a mapping, not a list: {how}"
            self._wrong(value.place, why, as_mapping(value))
            given = {port: each for item in items for port, each in nested(item).items()}
            value = replace(value, value=given)
        if isinstance(value.value, str) and "\n" in value.value and value.label != value.place:
            sign = value.place.lines[value.place.line - 1][value.place.column - 1 :]
            why = f"leave out the {sign}: the ports of a node are a mapping, not a text"
            self._wrong(value.place, why, value.label.replaced(f"with: {sign}", "with:"))
            return {"": replace(value, value=REFUSED)}
        if not isinstance(value.value, dict):
            return {"": self.wired(value)}
        return {port: self.wired(item) for port, item in value.value.items()}


def _are_values(value: Located) -> bool:
    """Return True if a value is a mapping without nodes."""
    return bool(nested(value)) and not any(map(begins_node, nested(value)))


def _is_title(value: Located) -> bool:
    """Return True if a value is a text of several words."""
    return isinstance(value.value, str) and " " in value.value and not is_amount(value)


def _other_option(kind: str, keys: Mapping[str, Located]) -> dict[str, str]:
    """Return the option that the only unknown key of a control node means, by key; or {}."""
    options = {} if kind in FILES else kinds()[kind].options
    unknown = [key for key in keys if key not in {kind, "name", *options}]
    if len(unknown) != 1 or not is_amount(value := keys[unknown[0]]):
        return {}
    left = {option: each for option, each in options.items() if option not in keys}
    typed = measured(value) or ("integer" if isinstance(value.value, int) else "")
    fitting = [option for option, each in left.items() if each.type == typed]
    found = [option for option, each in left.items() if each.needed] or fitting
    return {unknown[0]: found[0]} if len(found) == 1 else {}


def is_number(value: object) -> TypeGuard[int]:
    """Return True if a value is a task number."""
    return type(value) is int and 0 <= value <= MAX_NUMBER


def as_node(keys: Mapping[str, Located]) -> str:
    """Return the values of a node in braces."""
    return "{" + ", ".join(f"{key}: {item.as_yaml()}" for key, item in keys.items()) + "}"


def _as_item(node: Mapping[str, Located]) -> str:
    """Return a node as an item of a list, in braces if it has several keys."""
    ((key, value), *more) = node.items()
    if not more:
        return key if value.value is None else f"{key}: {value.as_yaml()}"
    return as_node(node)


def _named_node(keys: dict[str, Located]) -> dict[str, Located]:
    """Return a node, or the node below its name; empty if no key begins a node."""
    inner = dict(nested(next(iter(keys.values()))))
    found = [node for node in (keys, inner) if any(map(begins_node, node))]
    return found[0] if found else {}


def respell(keys: Mapping[str, Located], likely: Mapping[str, str]) -> dict[str, Located]:
    """Return values by corrected keys."""
    return {likely.get(key, key): item for key, item in keys.items()}


def _no_node(value: Located, keys: tuple[str, ...]) -> str:
    """Return the message for a value that is not a node."""
    if isinstance(value.value, list):
        return "a list of nodes needs a node above it, such as sequence:"
    if not keys:
        return f"a node is a skill, a subtree, or a control node such as sequence, not {value}"
    if other := next((why for word, why in keywords().items() if word in keys), ""):
        return other
    if words := {word: kind for word, kind in synonyms().items() if word in keys}:
        return " and ".join(f"there is no {word}" + did_you_mean(words[word]) for word in words)
    near = "".join(did_you_mean(head) for head in likely_heads(keys).values())
    begun = [key for key in keys if key in heads() or key[:1].isupper()]
    if len(begun) > 1:
        return f"{' and '.join(begun)} are several nodes; begin each node of a list with a -"
    return f"one of {', '.join(keys)} must be a node, such as sequence, subtree or a skill{near}"
