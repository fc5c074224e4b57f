"""Export to the XML of BehaviorTree.CPP 4, with the node models that Groot2 needs.

The file shows the tree. It cannot move an arm, because the skills do not exist in C++.
"""

import xml.etree.ElementTree as ET

from skills import Skill

from .outline import Entry

FORMAT = "4"


def as_groot(root: Entry, number: int) -> str:
    """Return a file for Groot2.

    Args:
        root: Outline of a compiled tree.
        number: Number of the task.
    """
    name = f"task_{number}"  # a tree must not have the name of a skill
    document = ET.Element("root", BTCPP_format=FORMAT, main_tree_to_execute=name)
    _add(ET.SubElement(document, "BehaviorTree", ID=name), root)
    models = ET.SubElement(document, "TreeNodesModel")
    for kind in sorted({e.skill for e in root.walk() if e.skill}, key=lambda kind: kind.__name__):
        _model(models, kind)
    ET.indent(document)
    return ET.tostring(document, encoding="unicode", xml_declaration=True)


def _model(models: ET.Element, kind: type[Skill]) -> None:
    tag = "Condition" if kind.condition else "Action"
    model = ET.SubElement(models, tag, ID=kind.__name__)
    for port, info in kind.input_ports().items():
        ET.SubElement(model, "input_port", name=_port(port)).text = info.description
    for port, info in kind.output_ports().items():
        ET.SubElement(model, "output_port", name=_port(port)).text = info.description


def _add(parent: ET.Element, entry: Entry) -> None:
    shown = {"name": entry.name}
    if entry.skill:
        ports = {
            _port(port): _key(text) if port in entry.keys else _literal(text)
            for port, text in entry.ports.items()
        }
        ET.SubElement(parent, entry.skill.__name__, shown | ports)
    elif control := entry.control:
        for tag, attributes in control.kind.groot(control.options):
            parent = ET.SubElement(parent, tag, {**shown, **attributes})
        for child in entry.children[::-1] if control.kind.condition else entry.children:
            _add(parent, child)


def _port(name: str) -> str:
    """Return the name of a port. Changes `name`, because BehaviorTree.CPP reserves it."""
    return f"{name}_" if name == "name" else name


def _key(text: str) -> str:
    return "{" + text[1:].replace("/", "_") + "}"


def _literal(text: str) -> str:
    """Return a value without braces, because BehaviorTree.CPP reads text in braces as a key."""
    if text.startswith("{") and text.endswith("}"):
        return text[1:-1].replace(": ", ":").replace(", ", ";")
    return text
