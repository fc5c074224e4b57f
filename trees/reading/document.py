"""YAML read strictly, every value with its place: YAML 1.2 meanings, and nothing said twice.

Values are made here from the parser's events, by YAML 1.2's core schema and nothing else: a YAML
library's own constructors know more types than task files shall have, and some of them crash.
"""

import io
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionStartEvent,
    Event,
    MappingEndEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from trees.errors import FileError, Mistake, Place

MAX_BYTES = 256 * 1024
MAX_DEPTH = 32
MAX_TEXT = 1000
MAX_DIGITS = 32
MAX_MISTAKES = 1000

Scalar = str | int | float | bool | None


@dataclass(frozen=True, slots=True)
class StandIn:
    """A value that is given only when a task is called; until then its type is all that is known.

    Attributes:
        name: Of the parameter or port.
        type: Of its value.
    """

    name: str
    type: str

    def __str__(self) -> str:
        return f"${self.name}"

    __repr__ = __str__


# What stands for a value that is refused, so that what is around it can be judged all the same.
REFUSED = StandIn("", "any")


@dataclass(frozen=True, slots=True)
class Located:
    """A value and where it stands.

    Attributes:
        place: Where it begins.
        value: A scalar, a list of Located, or a dict of Located by text key.
        label: Where its key stands; where it has none, the same as `place`.
    """

    place: Place
    value: "Scalar | StandIn | list[Located] | dict[str, Located]"
    label: Place

    def plain(self) -> Any:
        """The value without places."""
        if isinstance(self.value, dict):
            return {key: item.plain() for key, item in self.value.items()}
        if isinstance(self.value, list):
            return [item.plain() for item in self.value]
        return self.value

    def __str__(self) -> str:
        text = _written(self.plain())
        return text if len(text) <= 60 else f"{text[:57]}..."


def _written(plain: Any) -> str:
    """A value about as YAML writes it."""
    if isinstance(plain, dict):
        return "{" + ", ".join(f"{key}: {_written(item)}" for key, item in plain.items()) + "}"
    if isinstance(plain, list):
        return "[" + ", ".join(map(_written, plain)) + "]"
    words = {None: "null", True: "true", False: "false"}
    return words[plain] if plain is None or isinstance(plain, bool) else repr(plain)


def read_text(path: Path) -> str:
    """Read a file, as far as it may be long.

    Raises:
        FileError: It cannot be read, is no ordinary file, too long, or not UTF-8.
    """
    start = Place(path, 1, 1)
    try:
        if path.exists() and not path.is_file():  # a pipe or device would never end
            raise FileError([Mistake(start, "is no ordinary file")])
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise FileError([Mistake(start, f"cannot be read: {error.strerror}")]) from error
    if len(data) > MAX_BYTES:
        raise FileError([Mistake(start, f"longer than {MAX_BYTES} bytes")])
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        shown = _lines(data.decode("utf-8", "replace"))
        place = _place_of(path, data[: error.start].decode("utf-8"), shown)
        raise FileError([Mistake(place, f"is not UTF-8 text: {error.reason}")]) from error


def read_document(path: Path, text: str) -> Located:
    """Read one YAML document.

    Args:
        path: Named in errors.
        text: What to read.

    Raises:
        FileError: Not YAML, too long, too deep, a tag, an alias, or a key given twice.
    """
    root, mistakes = draft_document(path, text)
    if mistakes:
        raise FileError(mistakes)
    return root


def draft_document(path: Path, text: str) -> tuple[Located, list[Mistake]]:
    """Read one YAML document as far as it can be read.

    Args:
        path: Named in errors.
        text: What to read.

    Returns:
        The document, with None in place of every value that is refused, and why they are.

    Raises:
        FileError: It cannot be read on: not YAML, too long, too deep.
    """
    text = text.removeprefix("\ufeff")
    if len(text) > MAX_BYTES:
        raise FileError([Mistake(Place(path, 1, 1), f"longer than {MAX_BYTES} characters")])
    if forbidden := list(islice(_forbidden(path, text), MAX_MISTAKES)):
        raise FileError(forbidden)
    reader = _Reader(path, text)
    try:
        return reader.document(), reader.mistakes
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        place = Place(path, line, column, "", _lines(text))
        broken = Mistake(place, error.problem or "is not YAML")
        raise FileError([*reader.mistakes, broken]) from error


def nested(value: Located) -> Mapping[str, Located]:
    """The keys of a mapping; of anything else, none."""
    return value.value if isinstance(value.value, dict) else {}


def names_within(value: Located) -> Iterator[str]:
    """The names with a $ that stand in a value."""
    inner = value.value
    if isinstance(inner, str) and inner.startswith("$"):
        yield inner[1:]
    for item in inner if isinstance(inner, list) else nested(value).values():
        yield from names_within(item)


# A directive could change what values mean; control characters and Unicode's line separators
# would make editors and readers disagree about the text and its lines.
_FORBIDDEN = re.compile(
    r"^%|[^\t\n\r -~\xa0-\u2027\u202a-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]"
)


def _forbidden(path: Path, text: str) -> Iterator[Mistake]:
    """The characters that may not be there, the first of every line."""
    lines = _lines(text)
    for number, line in enumerate(lines, 1):
        if found := _FORBIDDEN.search(line):
            place = Place(path, number, found.start() + 1, "", lines)
            what = "directives are" if found[0] == "%" else f"the character {found[0]!r} is"
            yield Mistake(place, f"{what} not allowed")


# YAML 1.2.2, section 10.3.2; what matches none is a text.
_CORE: tuple[tuple[re.Pattern[str], Callable[[str], Scalar]], ...] = tuple(
    (re.compile(pattern), make)
    for pattern, make in (
        (r"|~|null|Null|NULL", lambda _: None),
        (r"true|True|TRUE", lambda _: True),
        (r"false|False|FALSE", lambda _: False),
        (r"[-+]?[0-9]+", int),
        (r"0o[0-7]+", lambda text: int(text, 8)),
        (r"0x[0-9a-fA-F]+", lambda text: int(text, 16)),
        (r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", float),
        (r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", lambda text: float(text.replace(".", ""))),
    )
)


class _Plain(YAML):
    """Looks for no plug-ins, which would read a folder for every file."""

    def official_plug_ins(self) -> list[str]:
        """None."""
        return []


class _Reader:
    """Makes values of the parser's events.

    Attributes:
        mistakes: What was refused so far.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._lines = path, _lines(text)
        self._events = _Plain(typ="safe", pure=True).parse(io.StringIO(text))
        self.mistakes: list[Mistake] = []

    def document(self) -> Located:
        next(self._events)  # the stream begins
        begin = next(self._events)
        if isinstance(begin, StreamEndEvent):
            self._end(self._place(begin, ""), "the file is empty")
        root = self._value(next(self._events), 0, "")
        next(self._events)  # the document ends
        after = next(self._events)
        if not isinstance(after, StreamEndEvent):
            place = self._place(after, "")
            self._wrong(place, "a second document begins here; a file holds one")
        return root

    def _value(self, event: Event, depth: int, way: str, label: Place | None = None) -> Located:
        # The parser puts an empty value where the next token stands.
        place = label if label and _empty(event) else self._place(event, way)
        if depth > MAX_DEPTH:
            self._end(place, f"nested deeper than {MAX_DEPTH} levels")
        if isinstance(event, AliasEvent):
            self._wrong(place, "aliases (*name) are not allowed; write it out")
            return Located(place, None, label or place)
        assert isinstance(event, ScalarEvent | CollectionStartEvent)
        if event.tag is not None:
            self._wrong(place, f"tags are not allowed: {event.tag!r}")
        return Located(place, self._content(event, depth + 1, place), label or place)

    def _content(
        self, event: ScalarEvent | CollectionStartEvent, depth: int, place: Place
    ) -> Scalar | list[Located] | dict[str, Located]:
        if isinstance(event, ScalarEvent):
            return self._scalar(event, place)
        if isinstance(event, SequenceStartEvent):
            return self._items(depth, place.way)
        return self._mapping(depth, place.way)

    def _items(self, depth: int, way: str) -> list[Located]:
        items: list[Located] = []
        while not isinstance(event := next(self._events), SequenceEndEvent):
            items.append(self._value(event, depth, f"{way}[{len(items)}]"))
        return items

    def _mapping(self, depth: int, way: str) -> dict[str, Located]:
        values: dict[str, Located] = {}
        while not isinstance(event := next(self._events), MappingEndEvent):
            written = _printable(_joined(getattr(event, "value", "?")))
            below = f"{way}.{written}" if way else written
            key = self._value(event, depth, below)
            name = key.value
            if not isinstance(name, str):
                self._wrong(key.place, f"the key {key} is not a text")
            elif name in values:
                self._wrong(key.place, f"the key {name} is given twice")
            label = Place(self._path, key.place.line, key.place.column, below, self._lines)
            value = self._value(next(self._events), depth, below, label)
            if isinstance(name, str):
                values.setdefault(name, value)
        return values

    def _scalar(self, event: ScalarEvent, place: Place) -> Scalar:
        text = _joined(event.value)
        make = _core(text) if event.style is None else str
        if make is not str and len(text) > MAX_DIGITS:
            self._wrong(place, f"a number of more than {MAX_DIGITS} digits")
        elif len(text) > MAX_TEXT:
            self._wrong(place, f"a text of more than {MAX_TEXT} characters")
        elif odd := next((c for c in text if not c.isprintable() and c not in "\n\t"), None):
            self._wrong(place, f"the character {odd!r} is not allowed")
        else:
            return make(text) if event.tag is None else None
        return None

    def _place(self, event: Event, way: str) -> Place:
        mark = event.start_mark
        return Place(self._path, mark.line + 1, mark.column + 1, way, self._lines)

    def _wrong(self, place: Place, message: str) -> None:
        self.mistakes.append(Mistake(place, message))
        if len(self.mistakes) == MAX_MISTAKES:
            self._end(place, f"{MAX_MISTAKES} mistakes so far; what follows is not read")

    def _end(self, place: Place, message: str) -> NoReturn:
        raise FileError([*self.mistakes, Mistake(place, message)])


def _joined(text: str) -> str:
    """The text with what JSON writes as two escapes, halves of one character, put together."""
    if text.isascii():
        return text
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")


def _printable(key: str) -> str:
    return key if key.isprintable() else repr(key)[1:-1]


def _empty(event: Event) -> bool:
    if not isinstance(event, ScalarEvent):
        return False
    return not event.value and event.style is None and event.tag is None


def _core(text: str) -> Callable[[str], Scalar]:
    return next((make for pattern, make in _CORE if pattern.fullmatch(text)), str)


def _lines(text: str) -> list[str]:
    return re.split(r"\r\n|\r|\n", text)


def _place_of(path: Path, before: str, lines: list[str]) -> Place:
    """The place right after a text."""
    passed = _lines(before)
    return Place(path, len(passed), len(passed[-1]) + 1, "", lines)
