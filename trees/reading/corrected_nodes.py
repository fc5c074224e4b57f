"""Corrections of values that are not nodes: lists, booleans, comparisons, and if with then."""

import re
from collections.abc import Mapping
from dataclasses import replace

from trees.errors import Correction, Place

from .document import Located, nested
from .lines import block, in_node, replaced_block
from .node_words import FILES, begins_node, beside_keys

_COMPARISON = re.compile(r"([\w$.-]+) *(==|!=|<=|>=|<|>) *([\w$.-]+)")


def node_instead(value: Located, in_turn: str) -> Correction | None:
    """Return the lines of the node that a value most likely means; None if unclear.

    Args:
        value: The value.
        in_turn: Kind of control node that runs a list of nodes, one after the other.
    """
    keys = nested(value)
    if isinstance(value.value, list) and value.value:
        return in_node(value.place, in_turn)
    if value.value is None:
        return _example(value)
    if isinstance(value.value, bool):
        from skills import NODE_FOR  # slow; only for a mistake

        return value.instead(NODE_FOR[value.value])
    beside = {key: each for key, each in keys.items() if key not in ("if", "name")}
    if "if" in keys and sum(map(begins_node, beside)) == 1 and not {"then", "else"} & {*beside}:
        keys = {"if": keys["if"], "then": Located(value.place, beside, value.place)}
    if {"if", "then"} <= keys.keys() <= {"if", "then", "else"}:
        return replaced_block(value.place, _as_selector(keys))
    other = next((key for key in ("on_failure", "except", "catch", "then") if key in keys), "")
    first = {key: each for key, each in keys.items() if key not in (other, "name")}
    heads = [key for key in first if key == "try" or begins_node(key)]
    if other and "if" not in first and len(heads) == 1:
        own = first.get("try", Located(value.place, first, value.place))
        nodes = [_as_node(own), _as_node(keys[other])]
        head = f"{in_turn}:" if other == "then" else "selector:"
        return replaced_block(value.place, [head, *(f"  - {node}" for node in nodes)])
    return None


def apart(keys: Mapping[str, Located]) -> list[dict[str, Located]]:
    """Split a mapping with several nodes into one mapping per node. `with` stays at its subtree."""
    nodes = list[dict[str, Located]]()
    for key, each in keys.items():
        files = [node for node in nodes if node.keys() & FILES.keys()]
        if key == "with" and files:
            files[-1][key] = each
        elif nodes and (key in beside_keys() or not nodes[-1].keys() - beside_keys()):
            nodes[-1][key] = each
        else:
            nodes.append({key: each})
    return nodes


def twice(value: Located, in_turn: str) -> tuple[Place, Correction | None] | None:
    """Return the place of a second node with the same key, and all nodes as lines of a list.

    The result is None if the mapping has no such node. It is also None for an item of a list: only
    a `-` is missing then.
    """
    place, lines = value.place, [] if value.place.location.endswith("]") else block(value.place)
    keys = (re.match(r"[\w-]+(?=:)", line) for line in lines)
    heads = {row: key[0] for row, key in enumerate(keys) if key and begins_node(key[0])}
    words = [*heads.values()]
    again = [row for n, (row, word) in enumerate(heads.items()) if word in words[:n]]
    if not again or 0 not in heads:
        return None
    row, location = again[0], f"{place.location}.{heads[again[0]]}"
    there = replace(place, line=place.line + row, location=location)
    nodes = [f"  {'- ' if row in heads else '  '}{line}".rstrip() for row, line in enumerate(lines)]
    return there, replaced_block(place, [f"{in_turn}:", *nodes])


def comparison(value: Located) -> str:
    """Return the node for a text such as `$count > 3`, or `$ready`; "" for other values."""
    text = value.value if isinstance(value.value, str) else ""
    found = _COMPARISON.fullmatch(f"{text} == true" if re.fullmatch(r"\$\w+", text) else text)
    if not found:
        return ""
    from skills import compare_node  # slow; only for a mistake

    left, sign, right = found.groups()
    return compare_node(f"${left}" if left.isidentifier() else left, sign, right)


def _as_node(value: Located) -> str:
    """Return a node or a list of nodes as one node in braces."""
    items = value.value if isinstance(value.value, list) else [value]
    return items[0].as_yaml() if len(items) == 1 else f"{{sequence: {value.as_yaml()}}}"


def _as_selector(keys: Mapping[str, Located]) -> list[str]:
    """Return the lines of a selector that is equivalent to if, then and else."""
    from skills import condition_with  # slow; only for a mistake

    condition, ports = _as_node(keys["if"]), nested(keys["if"]).keys()
    condition = comparison(keys["if"]) or condition
    if name := ports and condition_with(ports):
        condition = f"{{{name}: {condition}}}"  # the file gives only the ports
    inverted = f"inverter: {condition}"
    nodes = {word: _as_node(keys[word]) for word in ("then", "else") if word in keys}
    if "else" not in nodes:
        return ["selector:", f"  - {inverted}", f"  - {nodes['then']}"]
    one = ["  - sequence:", f"      - {condition}", f"      - {nodes['then']}"]
    other = ["  - sequence:", f"      - {inverted}", f"      - {nodes['else']}"]
    return ["selector:", *one, *other]


def _example(value: Located) -> Correction | None:
    """Return the line with an example node after a key or a `-` that has no value."""
    from skills import wait_node  # slow; only for a mistake

    line = value.place.lines[value.place.line - 1]
    text, found = wait_node("1 s"), re.match(r"(\s*)(?:- +)?\w+:(?= *$)|(\s*)-(?= *$)", line)
    if not found:
        return None
    indent = "\n" + " " * (value.label.column + 1)
    return Correction(f"{found[0]}{indent if found[2] is None else ' '}{text}", value.place.line)
