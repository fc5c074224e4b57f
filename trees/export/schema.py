"""The JSON Schema of task files, made from the registered skills, for completion in editors."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from trees.compile.port_types import declarations, known_skills
from trees.declarations import ANY, LIST, TYPES, UNITS, Declaration
from trees.nodes.kind import KINDS
from trees.reading.library import Library
from trees.reading.node_parser import MAX_NUMBER

Schema = dict[str, Any]

NAME = "task.schema.json"

_NAME = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_-]*$"}
_KEY = {"type": "string", "pattern": "^\\$[A-Za-z]", "description": "a parameter, port or key"}
_LINE = {"type": "string", "minLength": 1}
_SHOWN = {"type": "string", "maxLength": 60, "description": "name of the node"}


def schema_text(library: Library) -> str:
    """Return the schema of task files, subtree files and files of poses, as text.

    Args:
        library: Library of the subtrees.

    Raises:
        FileError: A subtree file is not YAML.
    """
    subtrees = {name: library.draft(name)[0].parameters for name in library.subtrees()}
    return json.dumps(_schema(subtrees), indent=1) + "\n"


def _schema(subtrees: Mapping[str, Mapping[str, Declaration]]) -> Schema:
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "armtree task, subtree or poses",
        "type": "object",
        "if": {"required": ["poses"]},
        "then": _poses_file(),
        "else": {
            "if": {"required": ["subtree"]},
            "then": _file("subtree", _NAME, {"ports": _ports()}, ["description"]),
            "else": _file(
                "task",
                {"type": "integer", "minimum": 0, "maximum": MAX_NUMBER},
                {"name": _NAME, "parameters": _declared(), "retry": {"const": "safe"}},
                ["name", "description"],
            ),
        },
        "definitions": {
            "node": _node(subtrees),
            "positions": _positions(),
            **{kind: _quantity(kind) for kind in UNITS},
        },
    }


def _file(head: str, kind: Schema, more: Mapping[str, Schema], needed: list[str]) -> Schema:
    return {
        "properties": {
            head: kind,
            "description": _LINE,
            **more,
            "replaces": _NAME,
            "grammar": {"const": 1},
            "tree": {"$ref": "#/definitions/node"},
        },
        "required": [head, *needed, "tree"],
        "additionalProperties": False,
    }


def _poses_file() -> Schema:
    poses = {"type": "object", "additionalProperties": {"$ref": "#/definitions/positions"}}
    replaces = {"type": "array", "items": _NAME}
    return {
        "properties": {"poses": poses, "replaces": replaces, "grammar": {"const": 1}},
        "additionalProperties": False,
    }


def _declared(*more: str) -> Schema:
    """Return the schema of declarations of parameters or ports."""
    kind: Schema = {"enum": list(TYPES)}
    if more:  # a port may also have a type that only skills can write
        kind = {"anyOf": [kind, {"type": "string", "pattern": "^[A-Z]"}]}
    bound = {"type": ["number", "string"]}
    full = {
        "type": "object",
        "properties": {
            "type": kind,
            "default": {},
            "min": bound,
            "max": bound,
            "choices": {"type": "array", "items": {"type": "string"}},
            "description": _LINE,
            **{key: {"type": "boolean"} for key in more},
        },
        "required": ["type"],
        "additionalProperties": False,
    }
    return {"type": "object", "additionalProperties": {"anyOf": [kind, full]}}


def _ports() -> Schema:
    return {"anyOf": [{"type": "array", "items": _NAME}, _declared("output")]}


def _node(subtrees: Mapping[str, Mapping[str, Declaration]]) -> Schema:
    skills = {name: declarations(kind) for name, kind in known_skills().items()}
    bare = [
        name
        for name, ports in skills.items()
        if not any(p.needed and not p.output for p in ports.values())
    ]
    described = known_skills()
    heads: dict[str, Schema] = {
        name: _ports_of(ports) | {"description": _first_line(described[name].__doc__)}
        for name, ports in skills.items()
    }
    forms: list[Schema] = [{"enum": sorted(bare)}]
    forms += [_form(name, heads[name], {"name": _SHOWN}, []) for name in sorted(heads)]
    forms += [_control(kind) for kind in KINDS]
    forms += [
        _form("subtree", {"const": name}, {"with": _ports_of(ports), "name": _SHOWN}, _with(ports))
        for name, ports in sorted(subtrees.items())
    ]
    other = {"type": "string", "not": {"enum": sorted(subtrees)}}
    given: Schema = {"with": {"type": "object"}, "name": _SHOWN}
    forms.append(_form("subtree", other, given, []))
    forms.append(_form("task", {"type": "integer", "minimum": 0}, given, []))
    # Keys of all forms, because an editor offers them before it knows the form.
    offered = {"subtree": {"anyOf": [{"enum": sorted(subtrees)}, {"type": "string"}]}}
    return {"properties": offered, "anyOf": forms}


def _with(ports: Mapping[str, Declaration]) -> list[str]:
    return ["with"] if any(port.needed for port in ports.values()) else []


def _form(head: str, inner: Schema, beside: Mapping[str, Schema], needed: list[str]) -> Schema:
    return {
        "type": "object",
        "properties": {head: inner, **beside},
        "required": [head, *needed],
        "additionalProperties": False,
    }


def _control(name: str) -> Schema:
    kind = KINDS[name]
    node: Schema = {"$ref": "#/definitions/node"}
    inner = {"type": "array", "items": node, "minItems": 1} if kind.many else {"allOf": [node]}
    beside = {option: _value(declared) for option, declared in kind.options.items()}
    if kind.condition:
        beside[kind.condition] = node
    needed = [option for option, declared in kind.options.items() if declared.needed]
    needed += [kind.condition] if kind.condition else []
    return _form(name, inner | {"description": kind.description}, beside | {"name": _SHOWN}, needed)


def _ports_of(ports: Mapping[str, Declaration]) -> Schema:
    return {
        "type": "object",
        "properties": {name: _value(port) for name, port in ports.items()},
        "required": [name for name, port in ports.items() if port.needed and not port.output],
        "additionalProperties": False,
    }


def _value(wanted: Declaration) -> Schema:
    """Return the schema of a value or a reference."""
    if wanted.output:
        return _KEY | {"description": wanted.description}
    forms = [_literal(wanted), _KEY]
    return {"anyOf": [form for form in forms if form], "description": wanted.description}


def _literal(wanted: Declaration) -> Schema:
    if wanted.type.startswith(LIST):
        items = _literal(replace(wanted, type=wanted.type.removeprefix(LIST)))
        count = {"minItems": wanted.count, "maxItems": wanted.count} if wanted.count else {}
        return {"type": "array", "items": {"anyOf": [items, _KEY]}, **count}
    if wanted.type == "positions" or wanted.type in UNITS:
        return {"$ref": f"#/definitions/{wanted.type}"}
    bounds = {
        key: bound
        for key, bound in (("minimum", wanted.least), ("maximum", wanted.most))
        if bound is not None
    }
    plain: dict[str, Schema] = {
        "number": {"type": "number", **bounds},
        "integer": {"type": "integer", **bounds},
        "boolean": {"type": "boolean"},
        "text": {"enum": list(wanted.choices)} if wanted.choices else {"type": "string"},
        ANY: {"type": ["number", "string", "boolean"]},
        "": {"type": ["number", "string", "boolean", "object"]},
    }
    return plain.get(wanted.type, {"not": {}})


def _quantity(kind: str) -> Schema:
    units = "|".join(UNITS[kind])
    text = {"type": "string", "pattern": f"^[-+]?[0-9.]+([eE][-+]?[0-9]+)? ?({units})$"}
    unit = next(iter(UNITS[kind]))
    return {"anyOf": [{"type": "number"}, text], "description": f"without a unit, it is in {unit}"}


def _positions() -> Schema:
    position = {
        "anyOf": [*({"$ref": f"#/definitions/{kind}"} for kind in ("angle", "length")), _KEY]
    }
    return {
        "anyOf": [{"type": "object", "additionalProperties": position}, _NAME],
        "description": "joint values by joint name, or the name of a pose",
    }


def _first_line(text: str | None) -> str:
    return (text or "").strip().partition("\n")[0]
