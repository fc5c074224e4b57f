"""What programs of users rely on, one line each: codes, events, HTTP, `--json` and Python.

`python -m tests.support.generated.interfaces` prints the lines of this version, which
`interfaces.txt` in a folder of `tests/data/upgrades` keeps.
"""

import dataclasses
import inspect
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from enum import EnumType
from typing import Any

import armtree
from executive.api.events import EVENTS, UNITS
from executive.api.operations import OPERATIONS
from executive.server.http.openapi import document
from tests.support.codes import ROOMS, all_codes
from tests.support.paths import ROOT


def lines() -> Iterator[str]:
    """Yield each code, and each field and parameter with its type or its place."""
    for code, kind in all_codes().items():
        yield f"code {code}: exit status {kind.exit_status}"
    for of, event in EVENTS.items():
        for field in dataclasses.fields(of):
            yield f"event {event}: {UNITS.get(field.name, field.name)}"
    yield from _requests()
    printed = json.loads((ROOT / "docs" / "output.schema.json").read_text())
    for name, schema in printed["$defs"].items():
        for place, kinds in _fields(schema, "", printed):
            yield f"output {name} {place}: {kinds}"
    for name in armtree.__all__:
        yield from _python(f"python {name}", getattr(armtree, name))


def _requests() -> Iterator[str]:
    described = document(OPERATIONS.values())
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            for use, schema in _schemas(operation):
                request = "errors" if use == "answers 4XX" else f"{method.upper()} {path} {use}"
                for place, kinds in _fields(schema, "", described):
                    yield f"http {request} {place}: {kinds}"


def _python(name: str, thing: Any) -> Iterator[str]:
    """Yield a class or function, its parameters, and the methods that are of armtree."""
    yield name
    if not isinstance(thing, EnumType):  # Python's own, and not the same in each of its versions
        with suppress(TypeError, ValueError):  # a value, or a class that takes any arguments
            yield from (f"{name}: {each}" for each in inspect.signature(thing).parameters)
    if inspect.isclass(thing):
        for inner, member in inspect.getmembers(thing, inspect.isroutine):
            room = (getattr(member, "__module__", None) or "").partition(".")[0]
            if room in ROOMS and not inner.startswith("_"):
                yield from _python(f"{name}.{inner}", member)


def _schemas(operation: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for parameter in operation.get("parameters", ()):
        yield f"takes {parameter['name']}", parameter["schema"]
    for use, bodies in (("takes", {"": operation.get("requestBody", {})}),
                        ("answers", operation["responses"])):  # fmt: skip
        for status, body in bodies.items():
            for content in body.get("content", {}).values():
                yield f"{use} {status}".strip(), content["schema"]


def _fields(schema: Any, place: str, root: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the place of each value of a schema, and its types."""
    while "$ref" in schema:
        found: Any = root
        for key in schema["$ref"].removeprefix("#/").split("/"):
            found = found[key]
        schema = found
    choices = schema.get("anyOf", [schema])
    kinds = {kind for each in choices for kind in _kinds(each)}
    yield place or ".", " or ".join(sorted(kinds))
    for each in choices:
        for name, inner in each.get("properties", {}).items():
            yield from _fields(inner, f"{place}.{name}", root)
        for key, sign in (("items", "[]"), ("additionalProperties", ".*")):
            if isinstance(each.get(key), Mapping):
                yield from _fields(each[key], place + sign, root)


def _kinds(schema: Mapping[str, Any]) -> list[str]:
    if "const" in schema or "enum" in schema:
        return ["string"]
    kinds = schema.get("type", "object")
    return [kinds] if isinstance(kinds, str) else kinds


if __name__ == "__main__":
    print("\n".join(sorted({*lines()})))  # noqa: T201, what it is for
