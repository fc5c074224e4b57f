"""The OpenAPI document, generated from the rows of `operations`."""

from collections.abc import Iterable, Mapping
from typing import Any

from executive.api.operations import Access, Operation
from executive.api.schemas import ERROR, TEXT, Component, Schema
from hardware.installed import version

# Schemas of the content of other media than JSON. For a stream, it is the schema of an event.
_MEDIA: Mapping[str, Schema] = {
    "text/event-stream": {
        "type": "object",
        "properties": {"event": TEXT, "data": TEXT},
        "required": ["event", "data"],
    }
}


def document(operations: Iterable[Operation]) -> dict[str, Any]:
    """Return the OpenAPI 3.1 document of these operations."""
    components: dict[str, Any] = {}
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        described = _resolved(_described(operation), components)
        paths.setdefault(operation.path, {})[operation.method.lower()] = described
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "armtree",
            "version": version("armtree"),
            "description": "Goals for a robot arm. Positions [rad] are commanded, unless they are "
            "called measured. The stop is not an emergency stop.",
        },
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _described(operation: Operation) -> dict[str, Any]:
    codes = ", ".join((*operation.errors, "request"))
    schema = operation.answer or _MEDIA.get(operation.media, TEXT)
    described: dict[str, Any] = {
        "operationId": operation.name,
        "summary": operation.summary,
        "responses": {
            str(operation.status): {
                "description": operation.summary,
                "content": {operation.media: {"schema": schema}},
            },
            "4XX": {
                "description": f"Refused; `code` is one of, or begins with: {codes}.",
                "content": {"application/json": {"schema": ERROR}},
            },
        },
    }
    if operation.parameters:
        described["parameters"] = [
            {
                "name": name,
                "in": "path" if operation.in_path(name) else "query",
                "required": operation.in_path(name),
                "schema": schema,
            }
            for name, schema in operation.parameters.items()
        ]
    if operation.body is not None:
        described["requestBody"] = {
            "required": bool(operation.body.get("required")),
            "content": {"application/json": {"schema": operation.body}},
        }
    if operation.access is Access.CHANGE:
        described["security"] = [{"token": []}]
    return described


def _resolved(value: Any, components: dict[str, Any]) -> Any:
    """Replace every component in a value by a reference, and collect its schema."""
    match value:
        case Component():
            components[value.name] = _resolved(value.schema, components)
            return {"$ref": f"#/components/schemas/{value.name}"}
        case Mapping():
            return {key: _resolved(each, components) for key, each in value.items()}
        case list():
            return [_resolved(each, components) for each in value]
    return value
