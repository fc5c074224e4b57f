"""Repairs: small edits that correct the layout of a task file.

A YAML parser fails after the mistake, with technical words. Therefore this module corrects common
mistakes near that place, one by one. The edits that leave the fewest mistakes become the
correction.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import wraps
from itertools import compress, product
from pathlib import Path
from typing import TypeVar

from hardware.printable import plural
from hardware.spelling import closest
from trees.errors import Correction, FileError, Mistake, Place

from .document import NotYaml, split_lines
from .node_words import begins_node

_MAX_EDITS = 4
_KEPT = 10  # number of best texts that are edited further
# Largest total of characters read in a search: about a quarter second. A text counts as this many
# more, because each text also costs a fixed time.
_MAX_READ, _PER_TEXT = 125_000, 1_000
_MAX_TEXT = 25_000  # largest text for a search [characters]
_MAX_LEFT = 2  # largest number of mistakes in the edited lines of a repaired text

Drafted = TypeVar("Drafted")
Draft = Callable[[Path, str], tuple[Drafted, list[Mistake]]]
_Spot = tuple[int, int]  # index of a line, and of a character in it


@dataclass(frozen=True)
class _Edit:
    """A change of the text.

    Attributes:
        spot: Place of the mistake in the text.
        kind: Name of the slip that the edit undoes.
        why: Words for the mistake, for the message.
        lines: All lines after the change.
    """

    spot: _Spot
    kind: str
    why: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class _Version:
    """A text after some edits.

    Attributes:
        lines: Its lines.
        edits: The edits.
        rank: Rank; a lower rank is better.
        spots: Places of its mistakes.
        left: Number of its mistakes; None if it is not YAML.
        near: Number of its mistakes in the edited lines.
    """

    lines: tuple[str, ...]
    edits: tuple[_Edit, ...]
    rank: tuple[int, int, int]
    spots: Sequence[_Spot]
    left: int | None = None
    near: int = 0


def repairing(draft: Draft[Drafted]) -> Draft[Drafted]:
    """Make a function that reads files also report edits of their layout.

    The edits are used if they make a file valid, or make YAML of a file that is not YAML. They are
    then mistakes of the file, and the edited text is read.

    Args:
        draft: Function that reads a text and continues after mistakes.
    """

    @wraps(draft)
    def read(path: Path, text: str) -> tuple[Drafted, list[Mistake]]:
        broken, before = None, set[tuple[int, str]]()
        try:
            drafted, mistakes = draft(path, text)
            if all(mistake.instead for mistake in mistakes):
                return drafted, mistakes
            before = {(mistake.place.line, mistake.message) for mistake in mistakes}
        except NotYaml as error:
            broken = error
        found = _Search(draft, path, text).repaired()
        if found:
            repaired, left = draft(path, "\n".join(found.lines))
            still = {(mistake.place.line, mistake.message) for mistake in left}
            quoted = any(edit.kind in ("sign", "end") for edit in found.edits)
            if broken or not still or (before >= still and not quoted):
                return repaired, [*_mistakes(path, text, found.edits), *left]
        if broken:
            raise _without_tree(broken) or broken
        return drafted, mistakes

    return read


def _without_tree(broken: NotYaml) -> FileError | None:
    """Return the mistake of a list of nodes in the first column; None for other mistakes."""
    lines, begin = broken.place.lines, broken.place.line - 1
    listed = broken.place.column == 1 and lines[begin : begin + 1] and lines[begin].startswith("- ")
    if not listed or any(line.startswith("tree:") for line in lines):
        return None
    nodes = "\n".join(lines[begin:]).rstrip().split("\n")
    text = "\n".join(["tree:", "  sequence:", *(f"    {line}" for line in nodes)])
    why = "a list of nodes must be below tree: and a node such as sequence:"
    return FileError([Mistake(broken.place, why, Correction(text, begin + 1, len(nodes)))])


def _mistakes(path: Path, text: str, edits: Sequence[_Edit]) -> list[Mistake]:
    """Return one mistake for each kind of slip, at its first place."""
    lines = split_lines(text)
    first, changed, before = dict[str, _Edit](), dict[str, set[int]](), tuple(lines)
    moved = dict[str, set[int]]()
    for edit in edits:
        rows = {
            n for n, pair in enumerate(zip(before, edit.lines, strict=True)) if pair[0] != pair[1]
        }
        moved.setdefault(edit.kind, set()).update(rows)
        if edit.kind == "indent":  # the edit also moves other lines
            rows = {edit.spot[0]}
        if edit.kind == "dash":
            rows = {n for n in rows if edits[-1].lines[n].lstrip().startswith("- ")}
        if not any(edit.spot[0] in known for known in changed.values()):
            first.setdefault(edit.kind, edit)
        changed.setdefault(edit.kind, set()).update(rows)
        before = edit.lines
    found = []
    for edit in first.values():
        row, column = edit.spot
        same = sorted(n + 1 for n in changed[edit.kind] if n != row)
        also = f"; the same in line {', '.join(map(str, same))}" if same else ""
        place = Place(path, row + 1, column + 1, "", lines)
        rows = {row, *(n - 1 for n in same), *moved.get(edit.kind, ())}
        begin, end = min(rows), max(rows) + 1
        right = Correction("\n".join(edits[-1].lines[begin:end]), begin + 1, end - begin)
        found.append(Mistake(place, edit.why + also, right))
    return found


class _Search:
    """Searches for the edits that leave the fewest mistakes, breadth first."""

    def __init__(self, draft: Draft[Drafted], path: Path, text: str) -> None:
        self._draft, self._path = draft, path
        self._lines = tuple(split_lines(text.removeprefix("\ufeff")))
        self._read = 0

    def repaired(self) -> _Version | None:
        """Return the best text; None if no edits improve the text."""
        if sum(map(len, self._lines)) > _MAX_TEXT:
            return None
        start = self._version(self._lines, ())
        seen, best, now = {self._lines}, list[_Version](), [start]
        for _ in range(_MAX_EDITS):
            versions = []
            for version in now:
                for edit in _edits(version):
                    if edit.lines in seen or self._read > _MAX_READ:
                        continue
                    seen.add(edit.lines)
                    made = self._version(edit.lines, (*version.edits, edit))
                    if made.rank < version.rank:
                        versions.append(made)
            now = sorted(versions, key=lambda version: version.rank)[:_KEPT]
            best += [version for version in now if version.left is not None]
            if any(version.left == 0 for version in now):
                break
        found = min(best, key=lambda version: version.rank, default=None)
        return found if found and found.near <= _MAX_LEFT else None

    def _version(self, lines: tuple[str, ...], edits: tuple[_Edit, ...]) -> _Version:
        text = "\n".join(lines)
        self._read += len(text) + _PER_TEXT
        try:
            _, mistakes = self._draft(self._path, text)
        except NotYaml as error:
            opened = [_spot(error.opened, lines)] if error.opened else []
            rank = (1, -error.place.line, -error.place.column)
            spots = [*_spots(error.mistakes, lines), *opened]
            return _Version(lines, edits, rank, spots)
        except FileError as error:
            mistakes = [*error.mistakes]
        rank, spots = (0, len(mistakes), len(edits)), _spots(mistakes, lines)
        edited = {edit.spot[0] + 1 for edit in edits}
        near = sum(mistake.place.line in edited for mistake in mistakes)
        return _Version(lines, edits, rank, spots, len(mistakes), near)


def _spots(mistakes: Iterable[Mistake], lines: Sequence[str]) -> list[_Spot]:
    """Return the first places of mistakes."""
    return [*dict.fromkeys(_spot(mistake.place, lines) for mistake in mistakes)][:4]


def _spot(place: Place, lines: Sequence[str]) -> _Spot:
    """Return the place, or the end of the last line with content before it."""
    row = min(place.line, len(lines)) - 1
    if row == place.line - 1 and _content(lines[row]):
        return row, min(place.column - 1, len(lines[row]))
    row = _line_before(row, lines)
    return row, len(lines[row])


def _edits(version: _Version) -> Iterator[_Edit]:
    """Return the edits that undo a slip near the mistakes of a text."""
    lines, rows = version.lines, dict[int, None]()
    for row, _ in version.spots:
        if _content(lines[row]).endswith(":"):
            below = next((n for n in range(row + 1, len(lines)) if _content(lines[n])), row)
            begin, _, inner, _ = _columns(lines[row])
            rows |= {below: None} if _columns(lines[below])[0] in (begin, inner) else {}
        rows |= {row: None, _line_before(row, lines): None}
    yield from _foreign_sign_edits(lines)
    last = max(rows) if version.left is None else 0  # valid YAML has no open brackets
    yield from _slip_edits(lines, rows)
    for row in rows:
        yield from _closing_edits(lines, row, last)
    for row, column in version.spots:
        yield from _comma_edits(lines, row, column)
        for at, why, line in _sign_edits(lines[row], column):
            yield _Edit((row, at), "sign", why, _with_line(lines, row, line))
    for row in rows:
        yield from _dash_edits(lines, row)
        yield from _undashed(lines, row)
        yield from _indent_edits(lines, row)


def _with_line(lines: tuple[str, ...], row: int, line: str) -> tuple[str, ...]:
    return (*lines[:row], line, *lines[row + 1 :])


# Slips that people repeat in all lines: pattern, replacement and message.
_FOREIGN = (
    (re.compile("\t"), "  ", "tabs cannot indent; use spaces"),
    (re.compile("\t"), "    ", "tabs cannot indent; use spaces"),
    (re.compile("\xa0"), " ", "this is a non-breaking space; write an ordinary one"),
    (re.compile("[\u201c\u201d\u201e]"), '"', 'write the plain quote "'),
    (re.compile("[\u2018\u2019\u201a]"), "'", "write the plain quote '"),
    (re.compile(r"(?<!\S)[\u2013\u2014\u2212](?= \w+:)"), "-", "write the plain dash -"),
    (re.compile(r"^(\s*)-(?=[A-Za-z{\[])"), r"\1- ", "a space is missing after the `-`"),
    (
        re.compile(r"^(\s*)([*+\u2022]|\d+[.)])(?= [A-Za-z{])"),
        r"\1-",
        "every node of a list begins with a `-`",
    ),
)


def _foreign_sign_edits(lines: tuple[str, ...]) -> Iterator[_Edit]:
    """Return edits of foreign signs in all lines."""
    for odd, instead, why in _FOREIGN:
        spots = (
            (row, found.end() - 1) for row, line in enumerate(lines) if (found := odd.search(line))
        )
        if spot := next(spots, None):
            yield _Edit(spot, why, why, tuple(odd.sub(instead, line) for line in lines))


_InLine = tuple[int, str, str]  # column of a slip, message, and corrected line
_KEY = r"(^[\s-]*|(?<=[{,\[])\s*)([A-Za-z_][\w-]*)"
_TEXT = r"\s*[^\s\d$'\"{}\[\],:#][^'\"{}\[\],:#]*"

_AMOUNT = r"[-+]?[\d.]+(?: ?[a-z]+)?"

_CALL = r"the values of `\2` follow a colon, not in parentheses"
_IN_ONE_LINE = "two keys of a node in one line need braces and a comma"

_NUMBER = r"([-+]?[\d.]+)"

# Patterns of slips (group 2 is the place), replacement and message.
_SLIPS = (
    (
        r"((?:text|question): )([\w ]+: [\w .]+)(?=[,}]|$)",
        r'\1"\2"',
        r"a text with a colon needs quotes",
    ),
    (r"([:,\[] *)(- +)(?=[\d.])", r"\1-", r"no space follows the sign of a number"),
    (
        r"([:,\[] *)((['\"])([-+]?[\d.]+)\3)(?= ?[a-z]+ *[,}\]]| ?[a-z]+$)",
        r"\1\4",
        r"leave out the quotes of a number with a unit",
    ),
    (
        r"^(\s*- )((?:subtree|task): [\w-]+) (\{.*\})$",
        r"\1{\2, with: \3}",
        r"the values at ports are below the key with",
    ),
    (
        r"((?:^|[\s{\[,])[\w-]+: +)((?=([a-z]\w*): ))",
        r"\1{",
        r"a { is missing before `\3`",
    ),
    (r"(: +)((?=[^\[\]{}:,]+(,[^\[\]{}:,]+)*\]))", r"\1[", r"a [ is missing here"),
    (r"(\{)(\{)(?= *[\w-]+:)", r"\1", r"one { too many"),
    (_KEY + r":(?=[^\s:/\\])", r"\1\2: ", r"a space is missing after the colon of `\2`"),
    (_KEY + r" ?= ?(?=[^\s=])", r"\1\2: ", r"a colon separates `\2` from its value, not `=`"),
    (_KEY + r"$", r"\1\2:", r"a colon is missing after `\2`"),
    (_KEY + r"\s+(?=[^\s:=,}\]])", r"\1\2: ", r"a colon is missing after `\2`"),
    (r"^(\s*)(-)(?=[A-Za-z{\[])", r"\1- ", r"a space is missing after the `-`"),
    (r"()(\$\{(\w+)\})", r"$\3", r"write `$\3`, without braces"),
    (
        r"()(['\"]?(?:\{\{|<|%)\s*(\w+)\s*(?:\}\}|>|%)['\"]?)",
        r"$\3",
        r"write `$\3` for a parameter",
    ),
    (r"^(\s*- )(\w+)\((\w+) ?[=:] ?([^()]*)\)$", r"\1\2: {\3: \4}", _CALL),
    (r"^(\s*- )(\w+)\(([^()=:]+)\)$", r"\1\2: \3", _CALL),
    (r"((?:- |: ))(\w+)\(\)$", r"\1\2", r"write `\2`, without parentheses"),
    (
        r"^(\s*- )((?:subtree|task): [\w-]+) with ([^{}]+)$",
        r"\1{\2, with: {\3}}",
        _IN_ONE_LINE,
    ),
    (r"^(\s*- )((?:subtree|task): [\w-]+),?\s+(with: .*)$", r"\1{\2, \3}", _IN_ONE_LINE),
    (
        r"^([\s-]*[\w-]+: )((?=[a-z]|\w+: \{)(\w+): .*)$",
        r"\1{\2}",
        r"`\3` and its value need braces here",
    ),
    (r"(, *)(,)", r"\1", r"one comma too many"),
    (r"^(\s*- )(- )(?=\w)", r"\1", r"one `-` too many"),
    (r"^(\s*- )(\d+: +)(?=\S)", r"\1", r"leave out the number: the nodes of a list run in order"),
    (
        r"()('([^',{}\[\]]*'[^',{}\[\]]*)')",
        r'"\3"',
        r"put a text that contains ' in double quotes",
    ),
    (
        r"()(\"([^'{}\[\]]*\"[^'{}\[\]]*)\")(?=[,}\]]|$)",
        r"'\3'",
        r'put a text that contains " in single quotes',
    ),
    (
        rf"(\[)({_NUMBER}, *{_NUMBER}, *{_NUMBER}\] ?([a-z]+))",
        r"\1\3 \6, \4 \6, \5 \6]",
        r"each number of a list has its own unit",
    ),
    (r"()(\()([^()]*)\)", r"{\3}", r"write braces, not parentheses"),
    (r"()(\()([^()]*)\)", r"[\3]", r"write brackets, not parentheses"),
    (r"^(\s*)(//)", r"\1#", r"a comment begins with #, not with //"),
    (r"^(\s*)(/\*+ ?)(.*?)( ?\*/)?$", r"\1# \3", r"a comment begins with #, not with /*"),
    (r"()([;,])$", r"", r"leave out the `\2`"),
    (r"([{,] *[\w-]+: )(@(\w+))", r"\1$\3", r"write `$\3` for a parameter"),
    (
        rf"(\{{)(([A-Za-z_]\w*), *)(?={_AMOUNT}\}})",
        r"\1\3: ",
        r"a colon separates `\3` from its value, not a comma",
    ),
    (r"(: [\w-]+)(:)$", r"\1", r"leave out the `\2` at the end"),
    (r"()(;)", r",", r"a comma separates values, not `;`"),
    (r"(: *[-+]?\d+)(,)(?=\d)", r"\1.", r"a point begins the decimals, not a comma"),
    (rf"(: )({_AMOUNT}(, *{_AMOUNT})+)(?=[,}}]|$)", r"\1[\2]", r"a list needs brackets"),
    (rf"(: )({_TEXT}(,{_TEXT})+)(?=[,}}])", r'\1"\2"', r"a text with a comma needs quotes"),
    (
        rf"(: )([A-Za-z]+: {_TEXT}|[A-Z][\w ]*: [\w .]+)(?=[,}}])",
        r'\1"\2"',
        r"a text with a colon needs quotes",
    ),
)


def _slip_edits(lines: tuple[str, ...], rows: Iterable[int]) -> Iterator[_Edit]:
    """Return edits that undo one slip of a line, or all slips of its kind in some lines."""
    texts = {row: _split_comment(lines[row]) for row in rows}
    for pattern, instead, why in _SLIPS:
        found = {row: [*re.finditer(pattern, text)] for row, (text, _) in texts.items()}
        slips = [(row, slip) for row, each in found.items() for slip in each]
        for row, slip in slips:
            text, comment = texts[row]
            line = text[: slip.start()] + slip.expand(instead) + text[slip.end() :] + comment
            made = _with_line(lines, row, line)
            yield _Edit((row, slip.start(2)), why, slip.expand(why), made)
        if len(slips) > 1:
            row, slip = min(slips, key=lambda each: (each[0], each[1].start()))
            made = lines
            for each, (text, comment) in texts.items():
                made = _with_line(made, each, re.sub(pattern, instead, text) + comment)
            yield _Edit((row, slip.start(2)), why, slip.expand(why), made)


_HIDDEN = r": ((?:[^'\"{}\[\],]+ )?#[^'\"{}\[\],]*)(?=[,}\]])"  # a # inside a text
_QUOTES = ("'", '"')
_CLOSERS = {"{": "}", "[": "]", "'": "'", '"': '"'}


def _closing_edits(lines: tuple[str, ...], row: int, last: int) -> Iterator[_Edit]:
    """Return edits that close an open bracket or quote of a line, or put its text in quotes."""
    content, comment = _split_comment(lines[row])
    if hidden := re.search(_HIDDEN, lines[row]):
        why = "a # after a space begins a comment; put the text in quotes"
        line = f'{lines[row][: hidden.start(1)]}"{hidden[1]}"{lines[row][hidden.end() :]}'
        yield _Edit((row, hidden.start(1)), "slip", why, _with_line(lines, row, line))
    if stack := _unclosed(content):
        column = stack[-1]
        why = f"the {content[column]} of line {row + 1}, column {column + 1} is not closed"
        ends = [found.start() for found in re.finditer(r"[,}\]]", content) if found.end() > column]
        closer = _CLOSERS[content[column]]
        made = [f"{content[:end]}{closer}{content[end:]}" for end in ends]
        best = [_begins_other(content, end) for end in ends]
        whole = content + "".join(_CLOSERS[content[column]] for column in reversed(stack))
        quoted = closer in _QUOTES
        made = [*compress(made, best), *(made if quoted else ()), whole, *made]
        for line in made:
            yield _Edit((row, column), "end", why, _with_line(lines, row, line + comment))
        for below in range(row + 1, last + 1):
            text, comment = _split_comment(lines[below])
            if text:
                line = text + closer + comment
                yield _Edit((below, len(text)), "end", why, _with_line(lines, below, line))
    if found := re.match(
        r"(\s*(?:- )?(?!(?:with|subtree|task):)[A-Za-z_][\w-]*: +)([^\s'\"{\[].*)$", content
    ):
        quote = "'" if '"' in found[2] else '"'
        line = f"{found[1]}{quote}{found[2]}{quote}{comment}"
        why = "a text with special characters must be in quotes"
        yield _Edit((row, found.end(1)), "end", why, _with_line(lines, row, line))


def _begins_other(content: str, end: int) -> bool:
    """Return True if the key after a comma looks different from the keys in the bracket before."""
    key = re.match(r", *([\w-]+): *([^,}\]]*)", content[end:])
    begin = max(content.rfind("{", 0, end), content.rfind("[", 0, end))
    within = re.findall(r"([\w-]+): *([^,{}\[\]]*)", content[begin:end])
    return key is not None and not any(
        closest(key[1], [name]) or _form(value) == _form(key[2]) for name, value in within
    )


def _form(value: str) -> str:
    """Return a value with its numbers replaced by 0, and its words by a."""
    return re.sub(r"[A-Za-z_]+", "a", re.sub(r"[-+]?[\d.]+", "0", value.strip()))


def _comma_edits(lines: tuple[str, ...], row: int, column: int) -> Iterator[_Edit]:
    """Return an edit that separates a line in brackets from the line before it."""
    above = _line_before(row, lines)
    content, comment = _split_comment(lines[above])
    begins = re.fullmatch(r"\s*[\w'\"-]*", lines[row][:column])
    if above < row and begins and content[-1:] not in ",{[:":
        why = "a comma is missing at the end of the line"
        made = _with_line(lines, above, f"{content},{comment}")
        yield _Edit((above, len(content)), why, why, made)


def _sign_edits(line: str, column: int) -> Iterator[_InLine]:
    """Return edits of the characters at the mistake."""
    before, after = line[:column], line[column:]
    if after.startswith(("}", "]")):
        sign, other = after[0], {"}": "]", "]": "}"}[after[0]]
        yield column, f"this {sign} closes nothing", before + after[1:]
        why = f"{sign} does not close what is open here; write {other}"
        yield column, why, before + other + after[1:]
    if after.startswith(",") and before.endswith(("}}", "]]")):
        yield column - 1, f"one {before[-1]} too many", before[:-1] + after
    if word := re.search(r"[\w'\"}\]]\s+([\w'\"$-]+)\s*$", before):
        at = word.start(1)
        yield at, f"a comma is missing before `{word[1]}`", f"{before[:at].rstrip()}, {line[at:]}"
    if value := re.match(r"(?!!\w)[^\s,}\]\[{#'\"][^,}\]#]*(?<!\s)", after):
        made = f'{before}"{value[0]}"{after[value.end() :]}'
        yield column, f"{value[0]} must be in quotes", made


def _dash_edits(lines: tuple[str, ...], row: int) -> Iterator[_Edit]:
    """Return edits that add a `-` to a line, or to every line in the same column."""
    found = re.match(r"(\s*)([A-Za-z_][\w-]*)", lines[row])
    if not (found and begins_node(found[2])) or (found[2] == "task" and not found[1]):
        return
    margin = found.end(1)
    why = f"a `-` is missing before `{found[2]}`: every node of a list begins with one"
    for left, end in (0, row + 1), (2, row + 1), (0, _end_of_block(lines, row, margin - 1)):
        made = [
            f"{line[: margin - left]}- {line[margin:]}" if _columns(line)[0] == margin else line
            for line in lines[row:end]
        ]
        if left <= margin:
            yield _Edit((row, margin), "dash", why, (*lines[:row], *made, *lines[end:]))


def _undashed(lines: tuple[str, ...], row: int) -> Iterator[_Edit]:
    """Return an edit that joins a line to the node above it."""
    found = re.match(r"(\s*)- (\w+)", lines[row])
    if found and (not begins_node(found[2]) or found[2] == "task"):
        why = f"leave out the `-` before `{found[2]}`: it begins no item of a list"
        line = f"{found[1] and f'{found[1]}  '}{lines[row][found.start(2) :]}"
        yield _Edit((row, found.end(1)), "dash", why, _with_line(lines, row, line))


def _end_of_block(lines: Sequence[str], row: int, column: int) -> int:
    """Return the next line that begins in a column or before it."""
    rows = range(row + 1, len(lines))
    return next(
        (n for n in rows if _content(lines[n]) and _columns(lines[n])[0] <= column), len(lines)
    )


def _indent_edits(lines: tuple[str, ...], row: int) -> Iterator[_Edit]:
    """Return edits that move a line, with the lines that belong to it, to another column."""
    now, shown = _columns(lines[row])[:2]
    columns = dict[int, str]()  # columns of the lines above, with advice
    for above in reversed(range(row)):
        if not _content(lines[above]):
            continue
        indent, first, inner, key = _columns(lines[above])
        if lines[above].rstrip().endswith(":"):
            columns.setdefault(inner + 2, f"it belongs to `{key}` in line {above + 1}")
        columns.setdefault(inner, f"indent it like `{key}` in line {above + 1}")
        columns.setdefault(indent, f"indent it like `{first}` in line {above + 1}")
    tabs = "\t" in lines[row][:now]
    one = row + 1 if tabs else _end_of_block(lines, row, now)
    ends = dict.fromkeys([one, one if tabs else _end_of_block(lines, row, now - 1)])
    likely = sorted(columns.keys() - {now}, key=lambda column: abs(column - now))
    for end, column in product(ends, likely):
        moved = tuple(_indented_by(line, column - now) for line in lines[row:end])
        spaces = plural(now, "space")
        why = f"`{shown}` is indented by {spaces}, not {column}: {columns[column]}"
        if end > one:
            why += "; move the lines below it, too"
        elif any(map(_content, lines[row + 1 : end])):
            why += "; move the lines that belong to it, too"
        why = "tabs cannot indent; use spaces" if tabs else why
        yield _Edit((row, now), "indent", why, (*lines[:row], *moved, *lines[end:]))


def _columns(line: str) -> tuple[int, str, int, str]:
    """Return the column and beginning of a line's content, and of the first key in it."""
    found = re.match(r"(\s*)((?:- +)*)([\w-]*)", line)
    assert found
    key = found[3] or found[2].strip() or line.strip()
    return len(found[1]), found[2] + found[3] or key, found.end(2), key


def _indented_by(line: str, by: int) -> str:
    margin = _columns(line)[0]
    return " " * max(0, margin + by) + line[margin:] if line.strip() else line


def _content(line: str) -> str:
    """Return a line without spaces and comment."""
    return _split_comment(line)[0].strip()


def _split_comment(line: str) -> tuple[str, str]:
    """Return the content of a line, and its comment with the spaces before it."""
    content = re.split(r"(?:^|\s)\s*#", line, maxsplit=1)[0].rstrip()
    return content, line[len(content) :]


def _line_before(row: int, lines: Sequence[str]) -> int:
    """Return the last line with content before a line, or the first line."""
    return next((above for above in reversed(range(row)) if _content(lines[above])), 0)


def _unclosed(content: str) -> list[int]:
    """Return the columns of the brackets and quotes that a line does not close."""
    stack: list[int] = []
    for column, sign in enumerate(content):
        inside = content[stack[-1]] if stack else ""
        if inside in _QUOTES:
            if sign == inside:
                stack.pop()
        elif sign in "{[" or (sign in "'\"" and re.search(r"(^|[\s{\[,])$", content[:column])):
            stack.append(column)
        elif sign in "}]" and stack:
            if _CLOSERS[inside] != sign:
                break
            stack.pop()
    return stack
