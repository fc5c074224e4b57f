"""Export to the XML of BehaviorTree.CPP 4, with the node models that Groot2 needs.

It shows the tree; there are no nodes of these names in C++ that would move an arm.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from py_trees.behaviour import Behaviour

from skills import Skill
from trees.nodes.control import Guard, Repeat, Retry, Timeout, WaitFor

from .outline import Entry

FORMAT = "4"


def as_groot(root: Entry, number: int) -> str:
    """A file for Groot2.

    Args:
        root: Of the tree.
        number: Of the task.
    """
    name = f"task_{number}"  # a tree may not be called like a skill in it
    document = ET.Element("root", BTCPP_format=FORMAT, main_tree_to_execute=name)
    _add(ET.SubElement(document, "BehaviorTree", ID=name), root)
    models = ET.SubElement(document, "TreeNodesModel")
    for kind in sorted({type(e.node) for e in root.walk() if isinstance(e.node, Skill)}, key=_id):
        _model(models, kind)
    ET.indent(document)
    return ET.tostring(document, encoding="unicode", xml_declaration=True)


def _id(kind: type[Skill]) -> str:
    return kind.__name__


def _model(models: ET.Element, kind: type[Skill]) -> None:
    tag = "Condition" if kind.condition else "Action"
    model = ET.SubElement(models, tag, ID=kind.__name__)
    for port, info in kind.input_ports().items():
        ET.SubElement(model, "input_port", name=_port(port)).text = info.description
    for port, info in kind.output_ports().items():
        ET.SubElement(model, "output_port", name=_port(port)).text = info.description


def _add(parent: ET.Element, entry: Entry) -> None:
    node, shown = entry.node, {"name": entry.name}
    if isinstance(node, Skill):
        ports = {
            _port(port): _key(text) if port in entry.keys else _literal(text)
            for port, text in entry.ports.items()
        }
        ET.SubElement(parent, type(node).__name__, shown | ports)
        return
    tag, attributes = _control(entry.kind, node)
    element = ET.SubElement(parent, tag, shown | attributes | _timing(node))
    children = entry.children[::-1] if isinstance(node, Guard) else entry.children
    if isinstance(node, Guard) and node.pause:
        # A sequence that is tried again for ever waits where a guard would.
        element = ET.SubElement(element, "ReactiveSequence", shown)
    for child in children:
        _add(element, child)


def _port(name: str) -> str:
    """BehaviorTree.CPP keeps `name` and words that begin with an underscore to itself."""
    return f"{name}_" if name == "name" else name


def _key(text: str) -> str:
    return "{" + text[1:].replace("/", "_") + "}"


def _literal(text: str) -> str:
    """A value; not in braces, between which BehaviorTree.CPP takes it for a key."""
    if text.startswith("{") and text.endswith("}"):
        return text[1:-1].replace(": ", ":").replace(", ", ";")
    return text


def _timing(node: Behaviour | None) -> dict[str, str]:
    """What its nodes have no port for, as a description, which they all may have."""
    match node:
        case Retry() if node.backoff:
            return {"_description": f"after {node.backoff:g} s, which doubles each time"}
        case WaitFor() | Guard():
            return {"_description": f"asked every {node.every:g} s"}
    return {}


_CONTROLS: Mapping[str, str] = {
    "sequence": "Sequence",
    "reactive sequence": "ReactiveSequence",
    "selector": "Fallback",
    "reactive selector": "ReactiveFallback",
    "inverter": "Inverter",
    "force success": "ForceSuccess",
}


def _control(kind: str, node: Behaviour | None) -> tuple[str, dict[str, str]]:
    if kind in _CONTROLS:
        return _CONTROLS[kind], {}
    match node:
        case Retry():
            return "RetryUntilSuccessful", {"num_attempts": str(node.attempts)}
        case Repeat():
            return "Repeat", {"num_cycles": str(node.times or -1)}
        case Timeout():
            # Without an end where that is given only when the task is called.
            msec = round(node.after * 1000) if math.isfinite(node.after) else 0
            return "Timeout", {"msec": str(msec)}
        case Guard() if not node.pause:
            return "ReactiveSequence", {}
    if kind == "parallel":
        return "Parallel", _counts(-1, 1)
    if kind == "parallel, any":
        return "Parallel", _counts(1, -1)
    return "RetryUntilSuccessful", {"num_attempts": "-1"}  # wait for, and a guard that pauses


def _counts(success: int, failure: int) -> dict[str, str]:
    return {"success_count": str(success), "failure_count": str(failure)}
