"""Strict reading of YAML 1.2: every value with its place, no duplicate keys, no tags.

Values are made from the events of the parser, by the core schema of YAML 1.2. The constructors of
YAML libraries are not used, because they accept more types than task files allow, and some of them
crash.
"""

import io
import json
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterator, Mapping, Sequence
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

from hardware import read_file
from hardware.loading.dataclass import dataclass
from trees.errors import Correction, FileError, Mistake, Place

MAX_BYTES = 256 * 1024
MAX_DEPTH = 32
MAX_TEXT = 1000
MAX_DIGITS = 32
MAX_MISTAKES = 1000

Scalar = str | int | float | bool | None


@dataclass(frozen=True, slots=True)
class StandIn:
    """A placeholder for a value that is unknown before the run. Only its type is known.

    Attributes:
        name: Name of the parameter or port.
        type: Type of the value.
    """

    name: str
    type: str

    def __str__(self) -> str:
        return f"${self.name}"

    __repr__ = __str__


# Placeholder for a wrong value. The other values of its mapping can then be checked.
REFUSED = StandIn("", "any")


@dataclass(frozen=True, slots=True)
class Located:
    """A value and its place.

    Attributes:
        place: Start of the value.
        value: A scalar, a list of Located, or a dict of Located by text key.
        label: Place of its key; equal to `place` if it has no key.
        use: For the value of a parameter, the reference `$name` to the parameter, as a StandIn of
            the declared type. None for other values.
    """

    place: Place
    value: "Scalar | StandIn | list[Located] | dict[str, Located]"
    label: Place
    use: "Located | None" = None

    @property
    def declared(self) -> str:
        """Declared type of the parameter; empty for a value that is not from a parameter."""
        return self.use.value.type if self.use and isinstance(self.use.value, StandIn) else ""

    def plain(self) -> Any:
        """Return the value without places."""
        if isinstance(self.value, dict):
            return {key: item.plain() for key, item in self.value.items()}
        if isinstance(self.value, list):
            return [item.plain() for item in self.value]
        return self.value

    def as_yaml(self) -> str:
        """Return the value as YAML, in one line."""
        return _written(self.plain())

    def instead(self, text: str) -> Correction | None:
        """Return the line with a text in place of the value; None if it has several lines."""
        written = self.value if isinstance(self.value, str) else self.as_yaml()
        if isinstance(self.value, bool):
            return self.place.replaced(written, text) or self.place.replaced(written.title(), text)
        return self.place.replaced(self.place.brackets or written, text)

    def __str__(self) -> str:
        text = repr(self.value) if isinstance(self.value, str) else self.as_yaml()
        text = "nothing" if self.value is None else text
        return text if len(text) <= 60 else f"{text[:57]}..."


def _written(plain: Any) -> str:
    """Return a value approximately as YAML writes it."""
    if isinstance(plain, dict):
        return "{" + ", ".join(f"{key}: {_written(item)}" for key, item in plain.items()) + "}"
    if isinstance(plain, list):
        return "[" + ", ".join(map(_written, plain)) + "]"
    if isinstance(plain, str):
        safe = re.fullmatch(r"[\w$.+/-]+( [\w$.+/-]+)*", plain) and _core(plain) is str
        return plain if safe else json.dumps(plain, ensure_ascii=False)
    return "null" if plain is None else str(plain).lower()


class NotYaml(FileError):
    """A text is not YAML.

    Args:
        known: Mistakes that were found before this one.
        place: Place at which the parser fails.
        opened: Start of the value in which the parser fails, or None.
    """

    def __init__(self, known: Sequence[Mistake], place: Place, opened: Place | None = None) -> None:
        self.place, self.opened = place, opened
        why = "YAML does not allow this here"
        if opened and opened.line <= len(opened.lines):
            sign = opened.lines[opened.line - 1][opened.column - 1 : opened.column]
            if sign in ("{", "[", "'", '"') and sign:
                why = f"the {sign} of line {opened.line}, column {opened.column} is not closed"
        advice = "check indentation, colons, commas, quotes and brackets"
        super().__init__([*known, Mistake(place, f"{why}; {advice}")])


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        FileError: The file cannot be read, is not an ordinary file, is too long, or is not UTF-8.
    """
    start = Place(path, 1, 1)
    try:
        data = read_file(path, MAX_BYTES)
    except OSError as error:
        raise FileError([Mistake(start, f"cannot be read: {error.strerror}")]) from error
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        why = "is not UTF-8 text; save it as UTF-8 in your editor"
        if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
            raise FileError([Mistake(start, why)]) from error
        shown = split_lines(data.decode("utf-8", "replace"))
        place = _place_of(path, data[: error.start].decode("utf-8"), shown)
        raise FileError([Mistake(place, why)]) from error


def draft_document(path: Path, text: str, location: str = "") -> tuple[Located, list[Mistake]]:
    """Read one YAML document. Continue after mistakes.

    Args:
        path: File name for errors.
        text: Text of the document.
        location: Location of the document. The locations of its values begin with this text.

    Returns:
        The document, with None in place of every wrong value; and the mistakes.

    Raises:
        FileError: The text is not YAML, is too long, or is nested too deeply.
    """
    text = text.removeprefix("\ufeff")
    if len(text) > MAX_BYTES:
        raise FileError([Mistake(Place(path, 1, 1), f"longer than {MAX_BYTES} characters")])
    if forbidden := list(islice(_forbidden(path, text), MAX_MISTAKES)):
        raise FileError(forbidden)
    reader = _Reader(path, text)
    try:
        return reader.document(location), reader.mistakes
    except MarkedYAMLError as error:
        marks = [mark for mark in (error.problem_mark, error.context_mark) if mark]
        lines = split_lines(text)
        places = [Place(path, mark.line + 1, mark.column + 1, "", lines) for mark in marks]
        raise NotYaml(reader.mistakes, *places[:2]) from error


def nested(value: Located) -> Mapping[str, Located]:
    """Return the items of a mapping; empty for any other value."""
    return value.value if isinstance(value.value, dict) else {}


def reference(text: str) -> str:
    """Return `$name` for a reference of another program, such as `${name}`; else ""."""
    begin, end = r"(?:\$?\{\{?|\$\(|<|%)", r"(?:\}\}?|\)|>|%)"
    template = re.fullmatch(rf"{begin} *(?:[A-Za-z_]+\.|arg |env )*([A-Za-z_]\w*) *{end}", text)
    return f"${template[1]}" if template else ""


def calculates(text: str) -> bool:
    """Return True if a text calculates with a reference, such as `$swing * 2` or `-$swing`."""
    return re.fullmatch(r"[-+*/() \d.]*\$\w+( *[-+*/] *[\w$.() ]+)?", text) is not None and (
        re.fullmatch(r"\$\w[\w-]*", text) is None
    )


def no_calculation(text: str) -> str:
    """Return the message for a calculation with a parameter."""
    name = re.sub(r"\W+", "_", text.replace("-$", "minus_")).strip("_")
    why = "a task file does not calculate; declare another parameter for this value, such as"
    return f"{why} {name}, and write ${name}"


def names_within(value: Located) -> Iterator[str]:
    """Yield the names of the references in a value, without the $."""
    inner = value.value
    if isinstance(inner, str) and calculates(inner):
        yield from re.findall(r"\$(\w+)", inner)
    elif isinstance(inner, str) and inner.startswith("$"):
        yield (reference(inner) or inner)[1:]
    for item in inner if isinstance(inner, list) else nested(value).values():
        yield from names_within(item)


def texts_within(value: Located) -> Iterator[Located]:
    """Yield the texts in a value."""
    if isinstance(value.value, str):
        yield value
    for item in value.value if isinstance(value.value, list) else nested(value).values():
        yield from texts_within(item)


# A directive could change the meaning of values. Editors and parsers count lines differently if a
# text has control characters or Unicode's line separators.
_FORBIDDEN = re.compile(
    r"^%|[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]"
)


def _forbidden(path: Path, text: str) -> Iterator[Mistake]:
    """Yield a mistake for each line with a forbidden character."""
    lines = split_lines(text)
    for number, line in enumerate(lines, 1):
        if found := _FORBIDDEN.search(line):
            place = Place(path, number, found.start() + 1, "", lines)
            what = "directives are" if found[0] == "%" else f"the character {found[0]!r} is"
            right = Correction(_FORBIDDEN.sub("", line), number) if found[0] != "%" else None
            yield Mistake(place, f"{what} not allowed", right)


# YAML 1.2.2, section 10.3.2. A scalar without a match is a text.
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
    """A parser without plug-ins. The search for them would read a folder for every file."""

    def official_plug_ins(self) -> list[str]:
        """Return no plug-ins."""
        return []


class _Reader:
    """Makes values from the events of the parser.

    Attributes:
        mistakes: Mistakes so far.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._lines = path, split_lines(text)
        self._events = _Plain(typ="safe", pure=True).parse(io.StringIO(text))
        self.mistakes: list[Mistake] = []
        self._anchors: dict[str, tuple[Located, str]] = {}  # value and its text

    def document(self, location: str) -> Located:
        next(self._events)  # the stream begins
        begin = next(self._events)
        if isinstance(begin, StreamEndEvent):
            self._end(
                self._place(begin, ""), "the file is empty; `armtree new` writes one that runs"
            )
        root = self._value(next(self._events), 0, location)
        next(self._events)  # the document ends
        after = next(self._events)
        if not isinstance(after, StreamEndEvent):
            place = self._place(after, "")
            self._end(
                place, "a second document begins here; move the text from here on to another file"
            )
        return root

    def _value(
        self, event: Event, depth: int, location: str, label: Place | None = None
    ) -> Located:
        # The parser reports an empty value at the place of the next token.
        place = label if label and _empty(event) else self._place(event, location)
        if depth > MAX_DEPTH:
            self._end(place, f"nested deeper than {MAX_DEPTH} levels")
        if isinstance(event, AliasEvent):
            word = str(event.anchor)
            why = f"*{word} is an alias of YAML, which is not allowed; write the value itself"
            elsewhere = any(f"&{word}" in line for line in self._lines)
            meant, text = self._anchors.get(word, (None, "" if elsewhere else word))
            self._wrong(place, why, place.replaced(f"*{word}", text))
            return Located(place, meant.value if meant else None, label or place)
        assert isinstance(event, ScalarEvent | CollectionStartEvent)
        if event.tag is not None:
            self._wrong(place, f"tags are not allowed: {event.tag!r}; write the value itself")
        known = len(self.mistakes)
        made = Located(place, self._content(event, depth + 1, place), label or place)
        # An alias is a mistake, and wrong values are not kept. So no kept value has an alias, whose
        # text could grow exponentially.
        if event.anchor and len(self.mistakes) == known:
            self._anchors[str(event.anchor)] = made, made.as_yaml()
        return made

    def _content(
        self, event: ScalarEvent | CollectionStartEvent, depth: int, place: Place
    ) -> Scalar | list[Located] | dict[str, Located]:
        if isinstance(event, ScalarEvent):
            return self._scalar(event, place)
        if isinstance(event, SequenceStartEvent):
            return self._items(depth, place.location)
        return self._mapping(depth, place.location, in_braces=bool(event.flow_style))

    def _items(self, depth: int, location: str) -> list[Located]:
        items: list[Located] = []
        while not isinstance(event := next(self._events), SequenceEndEvent):
            items.append(self._value(event, depth, f"{location}[{len(items)}]"))
        return items

    def _mapping(self, depth: int, location: str, in_braces: bool) -> dict[str, Located]:
        values: dict[str, Located] = {}
        merged = dict[str, Located]()
        while not isinstance(event := next(self._events), MappingEndEvent):
            written = _printable(_joined(getattr(event, "value", "?")))
            below = f"{location}.{written}" if location else written
            key = self._value(event, depth, below)
            # A key is a text, even if it looks like a number.
            name = written if isinstance(key.value, str | int | float) else None
            if name is None:
                self._wrong(key.place, f"the key {key.as_yaml()} is not a text")
            elif name in values:
                first = values[name].label
                there = f"line {first.line}, column {first.column}"
                self._wrong(
                    key.place, f"the key {name} is given twice, first in {there}; remove one key"
                )
            label = Place(self._path, key.place.line, key.place.column, below, self._lines)
            event = next(self._events)
            value = self._value(event, depth, below, label)
            odd = (in_braces and values) or re.search(r"\W\S", written)
            if odd and value.value is None and value.place is label:
                self._wrong(label, f"{key} has no value; a key is followed by a colon and a space")
            if name == "<<" and isinstance(event, AliasEvent):
                merged[str(event.anchor)] = value
            elif name is not None:
                values.setdefault(name, value)
        for alias, value in merged.items():
            values = self._with_merged(values, alias, value, in_braces)
        return values

    def _with_merged(
        self, values: dict[str, Located], alias: str, merged: Located, in_braces: bool
    ) -> dict[str, Located]:
        """Report a `<<` that merges a mapping into another mapping. Return all values."""
        given = {key: each for key, each in nested(merged).items() if key not in values}
        between = ", " if in_braces else f"\n{' ' * (merged.label.column - 1)}"
        text = between.join(f"{key}: {each.as_yaml()}" for key, each in given.items())
        self.mistakes = [each for each in self.mistakes if each.place != merged.place]
        why = "<< is a merge of YAML, which is not allowed; write the keys themselves"
        right = merged.label.replaced(f"<<: *{alias}", text)
        self._wrong(merged.label, why, right)
        return {**values, **given}

    def _scalar(self, event: ScalarEvent, place: Place) -> Scalar:
        text = _joined(event.value)
        make = _core(text) if event.style is None else str
        if make is not str and len(text) > MAX_DIGITS:
            self._wrong(place, f"this number has more than {MAX_DIGITS} digits")
        elif len(text) > MAX_TEXT:
            self._wrong(place, f"this text has more than {MAX_TEXT} characters")
        elif odd := next((c for c in text if not c.isprintable() and c not in "\n\t"), None):
            right = place.replaced(text, text.replace(odd, "" if not odd.isspace() else " "))
            self._wrong(place, f"the character {odd!r} is not allowed", right)
        else:
            return make(text) if event.tag is None else None
        return None

    def _place(self, event: Event, location: str) -> Place:
        mark = event.start_mark
        return Place(self._path, mark.line + 1, mark.column + 1, location, self._lines)

    def _wrong(self, place: Place, message: str, instead: Correction | None = None) -> None:
        self.mistakes.append(Mistake(place, message, instead))
        if len(self.mistakes) == MAX_MISTAKES:
            self._end(place, f"{MAX_MISTAKES} mistakes so far; the rest of the file is not read")

    def _end(self, place: Place, message: str) -> NoReturn:
        raise FileError([*self.mistakes, Mistake(place, message)])


def _joined(text: str) -> str:
    """Combine surrogate pairs, because JSON writes some characters as two escapes."""
    if text.isascii():
        return text
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")


def _printable(key: str) -> str:
    return key if key.isprintable() else repr(key)[1:-1]


def _empty(event: Event) -> bool:
    if not isinstance(event, ScalarEvent):
        return False
    return not event.value and event.style is None and event.tag is None


def scalar(text: str) -> Scalar:
    """Return the value that YAML gives a text without quotes."""
    return _core(text)(text)


def _core(text: str) -> Callable[[str], Scalar]:
    return next((make for pattern, make in _CORE if pattern.fullmatch(text)), str)


def split_lines(text: str) -> list[str]:
    """Return the lines of a text, as YAML counts them."""
    return re.split(r"\r\n|\r|\n", text)


def _place_of(path: Path, before: str, lines: list[str]) -> Place:
    """Return the place after the text `before`."""
    passed = split_lines(before)
    return Place(path, len(passed), len(passed[-1]) + 1, "", lines)
