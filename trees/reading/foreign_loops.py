"""Loops as programming languages write them, such as `for: 3` with `do:`, and their correction.

A control node with its child at the same level, such as `repeat: 3` and `subtree:`, is also a loop.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from hardware.loading.dataclass import dataclass
from hardware.spelling import did_you_mean
from trees.errors import Correction, Place

from .corrected_nodes import comparison
from .document import Located, nested, reference, scalar
from .lines import key_block, replaced_block, rewritten
from .literals import in_unit_of_key
from .node_words import begins_node, in_turn, kinds

if TYPE_CHECKING:
    from trees.nodes.kind import ControlNodeKind

_DO, _CHILD = "do", "child"
_COUNT = re.compile("num_.*|max_.*|count")  # names of keys for the number of rounds
_AMOUNT = re.compile(r"[0-9.]+ ?([a-z]+)?")
_RANGE = re.compile(r"(?:\w+ in )?(?:range\(|1\.\.+)([0-9]+)\)?")
_EACH = re.compile(r"(\w+) in \[(.*)\]")
_ITEM = "item"  # variable of a loop over a list, if the file names none
EXAMPLES = {"integer": "3", "duration": "1 s"}  # example values of an option, by type


@dataclass(frozen=True, slots=True)
class ForeignLoop:
    """A loop of another language.

    Attributes:
        place: Place of the word for the loop.
        kind: Name of the control node that replaces the loop.
        why: Message for the user.
        keys: Values of the control node, by key.
        right: Correction with the control node; None if the number of rounds is unknown.
    """

    place: Place
    kind: str
    why: str
    keys: Mapping[str, Located]
    right: Correction | None


def read_loop(place: Place, given: Mapping[str, Located]) -> ForeignLoop | None:
    """Return the loop of another language that the keys of a node describe, or None.

    Args:
        place: Start of the node.
        given: Values of the node, by key.
    """
    given = _with_do(given)
    for word, kind in _loop_words(given):
        has_child = _DO in given or any(map(begins_node, given.keys() - {word}))
        loops = has_child and kind.limit and word in kind.synonyms
        each = _values(given[word]) if loops else None
        loop = _for_each(place, given, word, *each) if each else _read(place, given, word, kind)
        if loop:
            return loop
    return None


def _with_do(given: Mapping[str, Located]) -> Mapping[str, Located]:
    """Return values with `do` in place of another key for the child, such as `steps`."""
    words = [key for key in given if key in (_CHILD, *kinds()[in_turn()].synonyms)]
    if len(words) != 1 or _DO in given:
        return given
    return {_DO if key in words else key: each for key, each in given.items()}


def _loop_words(given: Mapping[str, Located]) -> Iterator[tuple[str, "ControlNodeKind"]]:
    """Yield the keys that may mean a control node with one child, each with its kind.

    These are names and synonyms of kinds. If a node has neither, they are conditions and first
    options of kinds.
    """
    for word in given:
        for kind in kinds().values():
            named = given.keys() & {kind.name} or given.keys() & {*kind.synonyms}
            option = word in [*kind.options][:1] and not given.keys() & kinds().keys()
            unnamed = not named and (option or word == kind.condition)
            if not kind.many and (word in named or unnamed):
                yield word, kind


def _read(
    place: Place, given: Mapping[str, Located], word: str, kind: "ControlNodeKind"
) -> ForeignLoop | None:
    """Return the loop that a word means, or None."""
    head, rest = _counted(given[word]), {key: each for key, each in given.items() if key != word}
    if word in kind.synonyms:
        head, counted = _without_option(in_unit_of_key(word, head), kind)
        rest |= counted
        rest = {kind.other_options.get(key, key): each for key, each in rest.items()}
    known, in_one = True, _DO in nested(head)  # such as {times: 3, do: open_gripper}
    rest |= nested(head) if in_one else {}
    options = {key: each for key, each in rest.items() if key in (*kind.options, kind.condition)}
    rest = {key: each for key, each in rest.items() if key not in options}
    if in_one:
        child, why = rest.pop(_DO), f"there is no {word}{did_you_mean(kind.name)}"
        own = f"write one node below {word}, such as {in_turn()}, and the options at the level of "
        own += word
        why = {kind.condition: kind.keywords.get(_DO, ""), kind.name: own}.get(word, why)
    elif (_DO in rest and not kind.only_asks) or sum(map(begins_node, rest)) == 1:
        why, option = _beside_child(word, head, kind, {*given})
        if not why:
            return None
        options = option | options
        known = bool(option) or isinstance(head.value, bool) or head.value in ("yes", "on")
        child = rest.pop(_DO) if _DO in rest else Located(place, rest, place)
    elif word in kind.synonyms and not is_amount(head) and (word.islower() or _has_node(head)):
        child, why = head, f"there is no {word}{did_you_mean(kind.name)}"
    else:
        return None
    lines = _lines_below(child)
    if child.value is rest:
        lines, rest = [line for each in rest.values() for line in key_block(each.label)], {}
    if rest.keys() - {"name"}:
        return None
    if isinstance(child.value, list):
        child = Located(child.place, {in_turn(): child}, child.label)
        lines = _below(in_turn(), lines) if lines else []
    options |= rest
    keys = {kind.name: child, **options}
    if place.brackets:
        right = place.replaced(place.brackets, Located(place, keys, place).as_yaml())
    else:
        node = _below(kind.name, lines) if lines else [f"{kind.name}: {child.as_yaml()}"]
        beside = (f"{key}: {comparison(each) or each.as_yaml()}" for key, each in options.items())
        right = replaced_block(place, [*node, *beside])
    return ForeignLoop(given[word].label, kind.name, why, keys, right if known else None)


def _counted(head: Located) -> Located:
    """Return the rounds of a text such as `range(3)`. In a mapping, name the child's key `do`."""
    if nested(head):
        return replace(head, value={**_with_do(nested(head))})
    found = _RANGE.fullmatch(head.value) if isinstance(head.value, str) else None
    return replace(head, value=int(found[1])) if found else head


def _values(head: Located) -> tuple[str, list[Located]] | None:
    """Return the variable and the values of a loop over a list; None for other loops."""
    if isinstance(head.value, list) and not any(map(nested, head.value)):
        return _ITEM, head.value
    if isinstance(head.value, str) and (found := _EACH.fullmatch(head.value)):
        return found[1], [replace(head, value=scalar(each.strip())) for each in found[2].split(",")]
    return None


def _for_each(
    place: Place, given: Mapping[str, Located], word: str, name: str, values: Sequence[Located]
) -> ForeignLoop:
    """Return a loop over a list, as one node for each value."""
    rest = {key: each for key, each in given.items() if key != word}
    child = rest.get(_DO, Located(place, rest, place))
    if isinstance(child.value, list):
        child = Located(child.place, {in_turn(): child}, child.label)
    nodes = [_with_value(child, f"${name}", each) for each in values]
    why = f"there is no loop over a list: write one node for each value, below {in_turn()}:"
    right = rewritten(place, {in_turn(): [node.as_yaml() for node in nodes]})
    keys = {in_turn(): Located(place, [*nodes], place)}
    return ForeignLoop(given[word].label, in_turn(), why, keys, right)


def _with_value(value: Located, name: str, meant: Located) -> Located:
    """Return a value in which the value `meant` replaces the reference `name`."""
    inner = value.value
    if isinstance(inner, str):
        return replace(value, value=meant.value) if name in (inner, reference(inner)) else value
    if isinstance(inner, list):
        return replace(value, value=[_with_value(each, name, meant) for each in inner])
    made = {key: _with_value(each, name, meant) for key, each in nested(value).items()}
    return replace(value, value=made) if made else value


def _beside_child(
    word: str, head: Located, kind: "ControlNodeKind", given: Collection[str]
) -> tuple[str, dict[str, Located]]:
    """Return the meaning of the value of a control node whose child is at another key.

    Args:
        word: Key of the value.
        head: The value.
        kind: The control node.
        given: All keys of the node.

    Returns:
        The message, or "" if the value may be the child; and the value by its correct key.
    """
    option, condition = next(iter(kind.options), ""), kind.condition
    why = f"write the child of {kind.name} below {kind.name}"
    if word in kind.synonyms:
        why = f"there is no {word}: {why}"
    if is_amount(head) and option:
        written = f"{option}: {head.as_yaml()}"
        return f"{why}, and the number in its own line: {written}", {option: head}
    switch = isinstance(head.value, bool) or head.value in ("yes", "on")
    if switch and (not condition or condition in given):
        return f"{why}, not at the same level", {}
    if isinstance(head.value, bool):
        from skills import EXAMPLE_CONDITION  # slow; only for a mistake

        asked = Located(head.place, EXAMPLE_CONDITION, head.place)
        return f"{why}, and the condition after {condition}:", {condition: asked}
    asks = isinstance(head.value, str) or _has_node(head)
    named = asks and condition and condition not in given
    if word == condition or named:
        why = f"{why}, and the key {condition} in its own line"
        return kind.keywords[_DO] if _DO in given else why, {condition: head}
    example = EXAMPLES.get(kind.options[option].type) if option else None
    if _DO in given and example:
        written = f"{option}: {example}"
        return f"{why}, and the number in its own line: {written}", {}
    return "", {}


def _without_option(head: Located, kind: "ControlNodeKind") -> tuple[Located, dict[str, Located]]:
    """Return a node without its number of rounds or its time, and that value by option."""
    inner, option = dict(nested(head)), next(iter(kind.options), "")
    timed = kind.timed and option
    timed_keys = {key for key, each in inner.items() if in_unit_of_key(key, each) is not each}
    counts = [key for key in inner if (key in timed_keys if timed else _COUNT.fullmatch(key))]
    if len(counts) != 1 or not option or not (timed or kind.options[option].type == "integer"):
        return head, {}
    given = {option: in_unit_of_key(counts[0], inner.pop(counts[0]))}
    return Located(head.place, inner, head.place), given


def _has_node(value: Located) -> bool:
    """Return True if a value is the name of a node, or a mapping with a key that begins one."""
    keys = (value.value,) if isinstance(value.value, str) else nested(value)
    return any(key == _DO or begins_node(key) for key in keys)


def _lines_below(child: Located) -> list[str]:
    """Return the lines below the key of a child, not indented; empty if there are none."""
    begin, *inner = key_block(child.label) or [""]
    if begin.partition(":")[2].split("#")[0].strip():
        return []
    margin = min((len(line) - len(line.lstrip()) for line in inner if line.strip()), default=0)
    return [line[margin:].rstrip() for line in inner]


def _below(head: str, lines: Sequence[str]) -> list[str]:
    """Return lines indented below a key."""
    return [f"{head}:", *(f"  {line}".rstrip() for line in lines)]


def is_amount(value: Located) -> bool:
    """Return True if a value is a number, with or without a unit."""
    plain = value.value
    number = isinstance(plain, int | float) and not isinstance(plain, bool)
    return number or (isinstance(plain, str) and _AMOUNT.fullmatch(plain) is not None)
