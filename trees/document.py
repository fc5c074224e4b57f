"""YAML read strictly, every value with its place: YAML 1.2 meanings, and nothing said twice."""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from .errors import FileError, Mistake, Place

MAX_BYTES = 256 * 1024
MAX_DEPTH = 32

Scalar = str | int | float | bool | None


@dataclass(frozen=True, slots=True)
class Located:
    """A value and where it stands.

    Attributes:
        place: Where it begins.
        value: A scalar, a list of Located, or a dict of Located by text key.
    """

    place: Place
    value: "Scalar | list[Located] | dict[str, Located]"

    def plain(self) -> Any:
        """The value without places."""
        if isinstance(self.value, dict):
            return {key: item.plain() for key, item in self.value.items()}
        if isinstance(self.value, list):
            return [item.plain() for item in self.value]
        return self.value


def read_document(path: Path, text: str) -> Located:
    """Read one YAML document.

    Args:
        path: Named in errors.
        text: What to read.

    Raises:
        FileError: Not YAML, too big, too deep, an alias, or a key given twice.
    """
    start = Place(path, 1, 1)
    if len(text.encode()) > MAX_BYTES:
        raise FileError([Mistake(start, f"longer than {MAX_BYTES} bytes")])
    try:
        loader = YAML(typ="safe", pure=True)
        node = loader.compose(io.StringIO(text))
        if node is None:
            raise FileError([Mistake(start, "the file is empty")])
        return _Reader(path, loader).read(node, 0)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(path, mark.line + 1, mark.column + 1) if mark else start
        raise FileError([Mistake(place, error.problem or "is not YAML")]) from error
    except (YAMLError, ValueError, RecursionError) as error:
        message = str(error).splitlines()[0]
        raise FileError([Mistake(start, f"is not YAML: {message}")]) from error


class _Reader:
    def __init__(self, path: Path, loader: Any) -> None:
        self._path, self._construct = path, loader.constructor.construct_object
        self._seen: set[int] = set()

    def read(self, node: Node, depth: int) -> Located:
        place = Place(self._path, node.start_mark.line + 1, node.start_mark.column + 1)
        if depth > MAX_DEPTH:
            raise FileError([Mistake(place, f"nested deeper than {MAX_DEPTH} levels")])
        if not isinstance(node, ScalarNode):
            if id(node) in self._seen:
                raise FileError([Mistake(place, "aliases (*name) are not allowed; write it out")])
            self._seen.add(id(node))
        if isinstance(node, SequenceNode):
            return Located(place, [self.read(item, depth + 1) for item in node.value])
        if isinstance(node, MappingNode):
            return Located(place, self._mapping(node, depth))
        value = self._construct(node)
        if not isinstance(value, Scalar):
            raise FileError([Mistake(place, f"{node.value!r} is no text, number or truth value")])
        return Located(place, value)

    def _mapping(self, node: MappingNode, depth: int) -> dict[str, Located]:
        values: dict[str, Located] = {}
        for key_node, value_node in node.value:
            key = self.read(key_node, depth + 1)
            if not isinstance(key.value, str):
                raise FileError([Mistake(key.place, f"the key {key.plain()!r} is not a text")])
            if key.value in values:
                raise FileError([Mistake(key.place, f"the key {key.value} is given twice")])
            values[key.value] = self.read(value_node, depth + 1)
        return values


def nested(value: Located) -> Mapping[str, Located]:
    """The keys of a mapping; of anything else, none."""
    return value.value if isinstance(value.value, dict) else {}
