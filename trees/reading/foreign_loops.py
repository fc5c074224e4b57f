"""Loops as programming languages write them, such as `for: 3` with `do:`, and their correction."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hardware.spelling import did_you_mean
from trees.errors import Correction, Place

from .document import Located, nested
from .lines import key_block, replaced_block

if TYPE_CHECKING:
    from trees.nodes.kind import ControlNodeKind

_DO = "do"
_COUNT = re.compile("num_.*|max_.*|count")  # names of the number of rounds
_AMOUNT = re.compile(r"[0-9.]+ ?([a-z]+)?")
EXAMPLES = {"integer": "3", "duration": "1 s"}  # example values of an option, by type


@dataclass(frozen=True, slots=True)
class ForeignLoop:
    """A loop of another language.

    Attributes:
        kind: Name of the control node for it.
        why: Message for the user.
        keys: Values of the control node.
        right: The control node in lines of a task file; None if unknown.
    """

    kind: str
    why: str
    keys: Mapping[str, Located]
    right: Correction | None


def read_loop(
    place: Place, given: Mapping[str, Located], kinds: "Mapping[str, ControlNodeKind]"
) -> ForeignLoop | None:
    """Return a loop of another language, or None if the keys of a node are not one.

    Args:
        place: Begin of the node.
        given: Values of the node.
        kinds: Kinds of control nodes, by name.
    """
    word, kind = _loop_word(given, kinds)
    if kind is None or kind.many:
        return None
    head, more = _counted(given[word], kind) if word in kind.synonyms else (given[word], {})
    more |= {key: each for key, each in given.items() if key != word}
    in_one = _DO in nested(head)  # such as {times: 3, do: open_gripper}
    more |= nested(head) if in_one else {}
    child = more.pop(_DO, head)
    why, known = f"there is no {word}{did_you_mean(kind.name)}", True
    if word == kind.condition and child is not head:
        more, why = {**more, word: head}, kind.keywords[_DO]
    elif child is not head and not in_one:
        if kind.only_asks or not kind.options:
            return None
        option, known = next(iter(kind.options)), is_amount(head)
        amount = head.as_yaml() if known else EXAMPLES[kind.options[option].type]
        why = f"{kind.name} has its node below it, and its number in a line of its own: "
        why += f"{option}: {amount}"
        more = {**more, option: head} if known else more
    elif _is_condition(word, head, kind) and more.keys() & {"subtree", "task"}:
        child, more = Located(place, more, place), {kind.condition: head}
        why = f"{kind.name} has the node below it, and {kind.condition} in a line of its own"
    elif word not in kind.synonyms or is_amount(head):
        return None
    if not more.keys() <= {*kind.options, kind.condition, "name"}:
        return None
    options = {key: each.as_yaml() for key, each in more.items()}
    in_turn = next(name for name, each in kinds.items() if each.many)
    lines = [
        *_below(kind.name, child, in_turn),
        *(f"{key}: {text}" for key, text in options.items()),
    ]
    if isinstance(child.value, list):
        child = Located(child.place, {in_turn: child}, child.label)
    keys = {kind.name: child, **more}
    right = replaced_block(place, lines)
    if place.brackets:
        right = place.replaced(place.brackets, Located(place, keys, place).as_yaml())
    return ForeignLoop(kind.name, why, keys, right if known else None)


def _loop_word(
    given: Iterable[str], kinds: "Mapping[str, ControlNodeKind]"
) -> "tuple[str, ControlNodeKind | None]":
    """Return the only key that means a control node, and its kind; None if there is none."""
    words = dict(kinds)
    for kind in kinds.values():
        words |= dict.fromkeys([*kind.synonyms, *filter(None, [kind.condition])], kind)
    (word, *others) = [key for key in given if key in words] or [""]
    return word, None if others else words.get(word)


def _is_condition(word: str, head: Located, kind: "ControlNodeKind") -> bool:
    """Return True if the value of a key is the condition of a control node, not its child."""
    return kind.condition == word or (bool(kind.condition) and isinstance(head.value, str))


def _counted(head: Located, kind: "ControlNodeKind") -> tuple[Located, dict[str, Located]]:
    """Return a node without its number of rounds, and the number by option."""
    inner, option = dict(nested(head)), next(iter(kind.options), "")
    counts = [key for key in inner if _COUNT.fullmatch(key)]
    if len(counts) != 1 or not option or kind.options[option].type != "integer":
        return head, {}
    given = {option: inner.pop(counts[0])}
    return Located(head.place, inner, head.place), given


def _below(head: str, child: Located, in_turn: str) -> list[str]:
    """Return the lines of a node with a child. Several nodes are put into one that runs them."""
    begin, *inner = key_block(child.label) or [""]
    several = isinstance(child.value, list)
    if not inner or begin.partition(":")[2].split("#")[0].strip():
        text = child.as_yaml()
        return [f"{head}: {{{in_turn}: {text}}}" if several else f"{head}: {text}"]
    margin = min(len(line) - len(line.lstrip()) for line in inner if line.strip())
    indent, between = ("    ", [f"  {in_turn}:"]) if several else ("  ", [])
    return [f"{head}:", *between, *(f"{indent}{line[margin:]}".rstrip() for line in inner)]


def is_amount(value: Located) -> bool:
    """Return True if a value is a number, with or without a unit."""
    plain = value.value
    number = isinstance(plain, int | float) and not isinstance(plain, bool)
    return number or (isinstance(plain, str) and _AMOUNT.fullmatch(plain) is not None)
