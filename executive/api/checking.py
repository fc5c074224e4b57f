"""Checks JSON against a schema. Errors name the wrong key and its valid values."""

from collections.abc import Callable
from typing import Any

import fastjsonschema

from .schemas import Schema

Checker = Callable[[Any], Any]


class Mismatch(ValueError):
    """A value does not fit its schema."""


def checker(schema: Schema) -> Checker:
    """Return a function that checks a value against a schema."""
    compiled: Checker = fastjsonschema.compile(dict(schema))
    return compiled


def checked(check: Checker, value: Any, whole: str) -> Any:
    """Return a value that a schema accepts.

    Args:
        check: The result of `checker`.
        value: The value.
        whole: Name of the whole value in errors, such as `the body`.

    Raises:
        Mismatch: The value is wrong.
    """
    try:
        return check(value)
    except fastjsonschema.JsonSchemaValueException as error:
        name = str(error.name)
        where = name.removeprefix("data").lstrip(".") or whole
        title = error.definition.get("title")
        words = f"must be {title}" if title else error.message.removeprefix(name).strip()
        raise Mismatch(f"{where} {words}") from error
