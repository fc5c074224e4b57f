"""Corrections of values that are not nodes: lists, switches, comparisons, and if with then."""

import re
from collections.abc import Mapping

from trees.errors import Correction

from .document import Located, nested
from .lines import in_node, replaced_block
from .node_words import begins_node

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
    return None


def comparison(value: Located) -> str:
    """Return the node for a text such as `$count > 3`; "" for other values."""
    found = _COMPARISON.fullmatch(value.value) if isinstance(value.value, str) else None
    if not found:
        return ""
    from skills import compare_node  # slow; only for a mistake

    return compare_node(*found.groups())


def _as_selector(keys: Mapping[str, Located]) -> list[str]:
    """Return the lines of a selector that is equivalent to if, then and else."""
    from py_trees.ports import get_ports_registry  # slow to load

    condition, ports = keys["if"].as_yaml(), nested(keys["if"]).keys()
    condition = comparison(keys["if"]) or condition
    for name, kind in get_ports_registry().items() if ports else ():
        if getattr(kind, "condition", False) and kind.input_ports().keys() == ports:
            condition = f"{{{name}: {condition}}}"  # the text had only the ports
            break
    inverted = f"inverter: {condition}"
    nodes = {
        word: ("sequence: " if isinstance(keys[word].value, list) else "") + keys[word].as_yaml()
        for word in ("then", "else")
        if word in keys
    }
    if "else" not in nodes:
        return ["selector:", f"  - {inverted}", f"  - {nodes['then']}"]
    one = ["  - sequence:", f"      - {condition}", f"      - {nodes['then']}"]
    other = ["  - sequence:", f"      - {inverted}", f"      - {nodes['else']}"]
    return ["selector:", *one, *other]


def _example(value: Located) -> Correction | None:
    """Return the lines with an example in place of a node that is not there."""
    from skills import wait_node  # slow; only for a mistake

    line = value.place.lines[value.place.line - 1]
    text, found = wait_node("1 s"), re.match(r"(\s*)(?:- +)?\w+:(?= *$)|(\s*)-(?= *$)", line)
    if not found:
        return None
    indent = "\n" + " " * (value.label.column + 1)
    return Correction(f"{found[0]}{indent if found[2] is None else ' '}{text}", value.place.line)
