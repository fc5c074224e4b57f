"""JSON from strangers: one meaning, or none."""

import json
import math
from collections import Counter
from typing import Any

MAX_BYTES = 64 * 1024  # of a body or a message


class NotJson(ValueError):
    """It is no JSON, or JSON that different readers understand differently."""


def parse(data: bytes | str) -> Any:
    """Read JSON in UTF-8.

    Raises:
        NotJson: It is none; or it has a key twice, a number that is not finite, half a surrogate
            pair, or brackets without end.
    """
    try:
        text = data.decode() if isinstance(data, bytes) else data
        value = json.loads(
            text, object_pairs_hook=_unique, parse_constant=_no_constant, parse_float=_finite
        )
        if "\\u" in text:
            json.dumps(value, ensure_ascii=False).encode()  # refuses half a surrogate pair
    except RecursionError as error:
        raise NotJson("too deep") from error
    except ValueError as error:
        raise NotJson(str(error)) from error
    return value


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise NotJson(f"the key {twice!r} is given twice")
    return made


def _no_constant(name: str) -> None:
    raise NotJson(f"{name} is no JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise NotJson(f"{text} is too large")
    return value
