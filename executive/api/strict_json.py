"""JSON from other programs. Ambiguous texts are refused."""

import json
import math
from collections import Counter
from typing import Any

MAX_BYTES = 64 * 1024  # largest body or message [bytes]


class NotJson(ValueError):
    """The text is not JSON, or it is ambiguous.

    Attributes:
        why: The mistake in words, without the place.
        line, column: The place, from 1; 0 if unknown.
    """

    def __init__(self, cause: str | ValueError) -> None:
        found = cause if isinstance(cause, json.JSONDecodeError) else None
        self.why = found.msg if found else str(cause)
        if found and found.doc[: found.pos].rstrip().endswith(","):
            self.why += "; leave out the comma before this place"
        self.line, self.column = (found.lineno, found.colno) if found else (0, 0)
        super().__init__(str(cause))


def parse(data: bytes | str) -> Any:
    """Read JSON in UTF-8.

    Raises:
        NotJson: The text is not JSON, it is nested too deep, or it has a duplicate key, a number
            that is not finite, or half a surrogate pair.
    """
    try:
        text = data.decode() if isinstance(data, bytes) else data
        value = _decoder.decode(text)
        if "\\u" in text:
            # Raises an error for half a surrogate pair.
            json.dumps(value, ensure_ascii=False).encode()
    except RecursionError as error:
        raise NotJson("it is nested too deep") from error
    except ValueError as error:
        raise NotJson(error) from error
    return value


def parse_object(data: bytes | str) -> dict[str, Any]:
    """Read a JSON object in UTF-8.

    Raises:
        NotJson: `parse` failed, or the value is not an object.
    """
    value = parse(data)
    if not isinstance(value, dict):
        raise NotJson("it is not a JSON object")
    return value


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        name = made.get("name")
        where = f" in {name}" if isinstance(name, str) and key != "name" else ""
        raise ValueError(f"the key {key!r} is given twice{where}")
    return made


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"the number {text} is too large")
    return value


_decoder = json.JSONDecoder(
    object_pairs_hook=_unique, parse_constant=_no_constant, parse_float=_finite
)
