"""JSON from the network. Texts that different readers understand differently are refused."""

import json
import math
from collections import Counter
from typing import Any

MAX_BYTES = 64 * 1024  # largest body or message [bytes]


class NotJson(ValueError):
    """The text is not JSON, or it is ambiguous."""


def parse(data: bytes | str) -> Any:
    """Read JSON in UTF-8.

    Raises:
        NotJson: The text is not JSON, is nested too deep, or has a duplicate key, a number that is
            not finite, or half a surrogate pair.
    """
    try:
        text = data.decode() if isinstance(data, bytes) else data
        value = json.loads(
            text, object_pairs_hook=_unique, parse_constant=_no_constant, parse_float=_finite
        )
        if "\\u" in text:
            json.dumps(value, ensure_ascii=False).encode()  # raises for half a surrogate pair
    except RecursionError as error:
        raise NotJson("too deep") from error
    except ValueError as error:
        raise NotJson(str(error)) from error
    return value


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        (key, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {key!r} is given twice")
    return made


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is too large")
    return value
