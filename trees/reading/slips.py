"""Slips in the layout of a task file, and the edits that undo them.

Each edit is one way to correct a line. `repairs` finds the edits that leave the fewest mistakes.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import compress, product

from hardware.loading.dataclass import dataclass
from hardware.printable import plural
from hardware.spelling import closest

from .node_words import begins_node

Spot = tuple[int, int]  # index of a line, and index of a character in this line


@dataclass(frozen=True, slots=True)
class Edit:
    """A change of the text.

    Attributes:
        spot: Place of the mistake in the text.
        kind: Name of the slip that the edit undoes.
        why: Message about the mistake.
        lines: All lines after the change.
    """

    spot: Spot
    kind: str
    why: str
    lines: tuple[str, ...]


def _edit(lines: tuple[str, ...], spot: Spot, why: str, text: str, kind: str = "") -> Edit:
    """Return the edit that replaces the content of a line. Default of `kind`: `why`."""
    return Edit(spot, kind or why, why, _with_content(lines, spot[0], text))


def _with_content(lines: tuple[str, ...], row: int, text: str) -> tuple[str, ...]:
    """Return the lines with new content in one line. The comment of this line stays."""
    comment = lines[row][len(content_of(lines[row])) :]
    return (*lines[:row], text + comment, *lines[row + 1 :])


def edits_near(lines: tuple[str, ...], spots: Sequence[Spot], is_yaml: bool) -> Iterator[Edit]:
    """Yield edits that may undo a slip of the layout near the mistakes of a text.

    Args:
        lines: The text.
        spots: Places of the mistakes.
        is_yaml: True if the text is YAML. All brackets are then closed.
    """
    rows = dict[int, None]()
    for row, _ in spots:
        if content_of(lines[row]).endswith(":"):
            below = next((n for n in range(row + 1, len(lines)) if content_of(lines[n])), row)
            begin, _, inner, _ = _columns(lines[row])
            rows |= {below: None} if _columns(lines[below])[0] in (begin, inner) else {}
        rows |= {row: None, line_before(row, lines): None}
    yield from _slip_edits(lines, rows)
    yield from _foreign_sign_edits(lines)
    last = 0 if is_yaml else max(rows)
    for row in rows:
        yield from _closing_edits(lines, row, last)
    for row, column in spots:
        yield from _comma_edits(lines, row, column)
        yield from _sign_edits(lines, row, column)
    for row in rows:
        yield from _dash_edits(lines, row)
        yield from _undashed(lines, row)
        yield from _indent_edits(lines, row)


_OUTSIDE = r'(?=(?:[^"]*"[^"]*")*[^"]*$)'  # outside a text in double quotes
# Slips that people usually make in all lines: pattern, replacement and message.
_FOREIGN: tuple[tuple[str, str | Callable[[re.Match[str]], str], str], ...] = (
    ("\t", "  ", "tabs cannot indent; use spaces"),
    ("\t", "    ", "tabs cannot indent; use spaces"),
    ("\xa0", " ", "this is a non-breaking space; write an ordinary space"),
    ("[\u201c\u201d\u201e]", '"', 'write the plain quote "'),
    ("[\u2018\u2019\u201a]", "'", "write the plain quote '"),
    (f"[\uff08-\uff1d\uff3b\uff3d\uff5b\uff5d]{_OUTSIDE}",
     lambda found: chr(ord(found[0]) - 0xFEE0),
     "this is a full-width character; write the plain character"),
    (r"^(\s*(?:- )?[A-Za-z_]\w*) *=(?= *[^\s=])", r"\1:",
     "a colon separates a key from its value, not `=`"),
    (r"(?<!\S)[\u2013\u2014\u2212](?= \w+:)", "-", "write the plain dash -"),
    (r"^(\s*)-(?=[A-Za-z{\[])", r"\1- ", "a space is missing after the `-`"),
    (r"^(\s*)([*+\u2022\u2192\u25cf]|\d+[.)])(?= [A-Za-z{])", r"\1-",
     "every node of a list begins with a `-`"),
)  # fmt: skip


def _foreign_sign_edits(lines: tuple[str, ...]) -> Iterator[Edit]:
    for odd, instead, why in _FOREIGN:
        found = ((row, re.search(odd, line)) for row, line in enumerate(lines))
        if spot := next(((row, slip.end() - 1) for row, slip in found if slip), None):
            yield Edit(spot, why, why, tuple(re.sub(odd, instead, line) for line in lines))


_KEY = r"(^[\s-]*|(?<=[{,\[])\s*)([A-Za-z_][\w-]*)"
_ITEM = r"^(\s*- )"
_BEGIN = r"^(\s*(?:- )?)"
_FILE = r"((?:subtree|task): [\w-]+)"
_TEXT = r"\s*[^\s\d$'\"{}\[\],:#][^'\"{}\[\],:#]*"
_NUMBER = r"([-+]?[\d.]+)"
_AMOUNT = r"[-+]?[\d.]+(?: ?[a-z]+)?"
_CALL = r"the values of `\2` follow a colon, not in parentheses"
_IN_ONE_LINE = "two keys of a node in one line need braces and a comma"

# Slips of a line: pattern (group 2 is the place), replacement and message. Earlier ones are more
# likely.
_SLIPS = (
    (r"((?:text|question): )([@`][^'\"{}\[\],:#]*)(?=[,}]|$)", r'\1"\2"',
     r"a text that begins with a special character needs quotes"),
    (r"((?:text|question): )([^'\"{}\[\],#$]+: [^'\"{}\[\],#]+)(?=[,}]|$)", r'\1"\2"',
     "a text with a colon needs quotes"),
    (r"([:,\[] *)(- +)(?=[\d.])", r"\1-", "leave out the space after the sign of a number"),
    (rf"([:,\[] *)((['\"]){_NUMBER}\3)(?= ?[a-z]+ *[,}}\]]| ?[a-z]+$)", r"\1\4",
     "leave out the quotes of a number with a unit"),
    (rf"{_ITEM}{_FILE} (\{{.*\}})$", r"\1{\2, with: \3}",
     "write the values at ports below the key with"),
    (r"((?:^|[\s{\[,])[\w-]+: +)((?=([a-z]\w*): ))", r"\1{", r"a { is missing before `\3`"),
    (r"(: +)((?=[^\[\]{}:,]+(,[^\[\]{}:,]+)*\]))", r"\1[", "a [ is missing here"),
    (r"(\{)(\{)(?= *[\w-]+:)", r"\1", "one { too many"),
    (rf"{_KEY}:(?=[^\s:/\\])", r"\1\2: ", r"a space is missing after the colon of `\2`"),
    (rf"{_KEY} ?= ?(?=[^\s=])", r"\1\2: ", r"a colon separates `\2` from its value, not `=`"),
    (rf"{_KEY}$", r"\1\2:", r"a colon is missing after `\2`"),
    (rf"{_KEY}\s+(?=[^\s:=,}}\]])", r"\1\2: ", r"a colon is missing after `\2`"),
    (r"()(['\"]?(?:\$\{|\{\{|<|%)\s*(\w+)\s*(?:\}\}?|>|%)['\"]?)", r"$\3",
     r"write `$\3` for a parameter"),
    (rf"{_BEGIN}(\w+)\((\w+) ?[=:] ?([^()]*)\)$", r"\1\2: {\3: \4}", _CALL),
    (rf"{_BEGIN}(\w+)\(([^()=:]+)\)$", r"\1\2: \3", _CALL),
    (r"((?:- |: ))(\w+)\(\);?$", r"\1\2", r"write `\2`, without parentheses"),
    (rf"{_ITEM}{_FILE} with ([^{{}}]+)$", r"\1{\2, with: {\3}}", _IN_ONE_LINE),
    (rf"{_ITEM}{_FILE},?\s+(with: .*)$", r"\1{\2, \3}", _IN_ONE_LINE),
    (r"^([\s-]*[\w-]+: )((?=[a-z]|\w+: \{)(\w+): .*)$", r"\1{\2}",
     r"`\3` and its value need braces here"),
    (r"(, *)(,)", r"\1", "one comma too many"),
    (rf"{_ITEM}(\d+: +)(?=\S)", r"\1", "leave out the number: the nodes of a list run in order"),
    (r"()('([^',{}\[\]]*'[^',{}\[\]]*)')", r'"\3"',
     "put a text that contains ' in double quotes"),
    (r"()(\"([^'{}\[\]]*\"[^'{}\[\]]*)\")(?=[,}\]]|$)", r"'\3'",
     'put a text that contains " in single quotes'),
    (rf"(\[)({_NUMBER}, *{_NUMBER}, *{_NUMBER}\] ?([a-z]+))", r"\1\3 \6, \4 \6, \5 \6]",
     "each number of a list has its own unit"),
    (r"()(\()([^()]*)\)", r"{\3}", "write braces, not parentheses"),
    (r"()(\()([^()]*)\)", r"[\3]", "write brackets, not parentheses"),
    (r"^(\s*)(//|/\*)\** ?(.*?)( ?\*/)?$", r"\1# \3", r"a comment begins with #, not with \2"),
    (r"^(.*[^\s:]\s+)(// ?)(?=[^/]*$)", r"\1# ", "a comment begins with #, not with //"),
    (r"()([;,])$", "", r"leave out the `\2`"),
    (rf"(\{{)(([A-Za-z_]\w*), *)(?={_AMOUNT}\}})", r"\1\3: ",
     r"a colon separates `\3` from its value, not a comma"),
    (r"(: [\w-]+)(:)$", r"\1", r"leave out the `\2` at the end of the line"),
    (r"()(;)", ",", "a comma separates values, not `;`"),
    (r"(: *[-+]?\d+)(,)(?=\d)", r"\1.", "a point begins the decimals, not a comma"),
    (r"([}\]])( ?(?:deg|rad|mm|cm|m|s|ms))(?= *[,}\]]|$)", r"\1",
     "each number has its own unit; leave out this one"),
    (rf"(: )({_AMOUNT}(, *{_AMOUNT})+)(?=[,}}]|$)", r"\1[\2]", "a list needs brackets"),
    (rf"(: )({_TEXT}(,{_TEXT})+)(?=[,}}])", r'\1"\2"', "a text with a comma needs quotes"),
    (rf"(: )([A-Za-z]+: {_TEXT}|[A-Z][\w ]*: [\w .]+)(?=[,}}])", r'\1"\2"',
     "a text with a colon needs quotes"),
    (r"(\w+: )([^'\"{}\[\],#$][^'#]*[\"{}][^'#]*)(?=\}$)", r"\1'\2'",
     "a text with special characters must be in quotes"),
)  # fmt: skip


def _slip_edits(lines: tuple[str, ...], rows: Iterable[int]) -> Iterator[Edit]:
    """Yield edits that undo one slip of a line, or all slips of one kind in some lines."""
    texts = {row: content_of(lines[row]) for row in rows}
    for pattern, instead, why in _SLIPS:
        slips = [(row, slip) for row in sorted(texts) for slip in re.finditer(pattern, texts[row])]
        for row, slip in slips:
            text = texts[row][: slip.start()] + slip.expand(instead) + texts[row][slip.end() :]
            yield _edit(lines, (row, slip.start(2)), slip.expand(why), text, why)
        if len(slips) > 1:
            row, slip = slips[0]
            made = lines
            for each, text in texts.items():
                made = _with_content(made, each, re.sub(pattern, instead, text))
            yield Edit((row, slip.start(2)), why, slip.expand(why), made)


_HIDDEN = r": ((?:[^'\"{}\[\],]+ )?#[^'\"{}\[\],]*)(?=[,}\]])"  # a # inside a text
_SPECIAL = r"(\s*(?:- )?(?!(?:with|subtree|task):)[A-Za-z_][\w-]*: +)([^\s'\"{\[].*)$"
_QUOTES = ("'", '"')
_CLOSERS = {"{": "}", "[": "]", "'": "'", '"': '"'}


def _closing_edits(lines: tuple[str, ...], row: int, last: int) -> Iterator[Edit]:
    """Yield edits that close an open bracket or quote of a line, or put a text in quotes."""
    line, text = lines[row], content_of(lines[row])
    if hidden := re.search(_HIDDEN, line):
        why = "a # after a space begins a comment; put the text in quotes"
        whole = f'{line[: hidden.start(1)]}"{hidden[1]}"{line[hidden.end() :]}'
        yield Edit((row, hidden.start(1)), why, why, (*lines[:row], whole, *lines[row + 1 :]))
    if stack := _unclosed(text):
        column = stack[-1]
        why = f"the {text[column]} of line {row + 1}, column {column + 1} is not closed"
        ends = [found.start() for found in re.finditer(r"[,}\]]", text) if found.end() > column]
        closer = _CLOSERS[text[column]]
        closed = [f"{text[:end]}{closer}{text[end:]}" for end in ends]
        likely = compress(closed, [_begins_other(text, end) for end in ends])
        whole = text + "".join(_CLOSERS[text[column]] for column in reversed(stack))
        for each in (*likely, *(closed if closer in _QUOTES else ()), whole, *closed):
            yield _edit(lines, (row, column), why, each, "end")
        for below in range(row + 1, last + 1):
            if inner := content_of(lines[below]):
                yield _edit(lines, (below, len(inner)), why, inner + closer, "end")
    if found := re.match(_SPECIAL, text):
        quote = "'" if '"' in found[2] else '"'
        why = "a text with special characters must be in quotes"
        made = f"{found[1]}{quote}{found[2]}{quote}"
        yield _edit(lines, (row, found.end(1)), why, made, "end")


def _begins_other(content: str, end: int) -> bool:
    """Return True if the key after a comma differs from all keys before it in the bracket."""
    key = re.match(r", *([\w-]+): *([^,}\]]*)", content[end:])
    begin = max(content.rfind("{", 0, end), content.rfind("[", 0, end))
    within = re.findall(r"([\w-]+): *([^,{}\[\]]*)", content[begin:end])
    return key is not None and not any(
        closest(key[1], [name]) or _form(value) == _form(key[2]) for name, value in within
    )


def _form(value: str) -> str:
    """Return a value in which each number is 0 and each word is `a`."""
    return re.sub(r"[A-Za-z_]+", "a", re.sub(r"[-+]?[\d.]+", "0", value.strip()))


def _comma_edits(lines: tuple[str, ...], row: int, column: int) -> Iterator[Edit]:
    """Yield an edit that adds a comma at the end of the line before a line in brackets."""
    above = line_before(row, lines)
    text = content_of(lines[above])
    begins = re.fullmatch(r"\s*[\w'\"-]*", lines[row][:column])
    if above < row and begins and text[-1:] not in ",{[:":
        why = "a comma is missing at the end of the line"
        yield _edit(lines, (above, len(text)), why, f"{text},")


def _sign_edits(lines: tuple[str, ...], row: int, column: int) -> Iterator[Edit]:
    """Yield edits of the characters at the place of a mistake."""
    before, after = lines[row][:column], content_of(lines[row])[column:]

    def edit(at: int, why: str, text: str) -> Edit:
        return _edit(lines, (row, at), why, text, "sign")

    if after.startswith(("}", "]")):
        sign, other = after[0], {"}": "]", "]": "}"}[after[0]]
        yield edit(column, f"this {sign} closes nothing", before + after[1:])
        why = f"{sign} does not close what is open here; write {other}"
        yield edit(column, why, before + other + after[1:])
    if after.startswith(",") and before.endswith(("}}", "]]")):
        yield edit(column - 1, f"one {before[-1]} too many", before[:-1] + after)
    if word := re.search(r"[\w'\"}\]]\s+([\w'\"$-]+)\s*$", before):
        at = word.start(1)
        text = f"{before[:at].rstrip()}, {before[at:]}{after}"
        yield edit(at, f"a comma is missing before `{word[1]}`", text)
    if value := re.match(r"(?!!\w|[\w-]+: )[^\s,}\]\[{#'\"][^,}\]#]*(?<!\s)", after):
        text = f'{before}"{value[0]}"{after[value.end() :]}'
        yield edit(column, f"{value[0]} must be in quotes", text)


def _dash_edits(lines: tuple[str, ...], row: int) -> Iterator[Edit]:
    """Yield edits that add a `-` to a line, or to every line in the same column."""
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
            yield Edit((row, margin), "dash", why, (*lines[:row], *made, *lines[end:]))


def _undashed(lines: tuple[str, ...], row: int) -> Iterator[Edit]:
    """Yield an edit that joins a line to the node above it, or leaves out one `-` of two."""
    if two := re.match(r"(\s*- )- (?=\w)", lines[row]):
        end = _end_of_block(lines, row, two.end(1))
        moved = [_indented_by(line, -2) for line in lines[row + 1 : end]]
        first = lines[row][: two.end(1)] + lines[row][two.end() :]
        made = (*lines[:row], first, *moved, *lines[end:])
        yield Edit((row, two.end(1)), "dash", "one `-` too many", made)
    found = re.match(r"(\s*)- (\w+)", lines[row])
    if found and (not begins_node(found[2]) or found[2] == "task"):
        why = f"leave out the `-` before `{found[2]}`: it begins no item of a list"
        text = f"{found[1] and f'{found[1]}  '}{content_of(lines[row])[found.start(2) :]}"
        yield _edit(lines, (row, found.end(1)), why, text, "dash")


def _end_of_block(lines: Sequence[str], row: int, column: int) -> int:
    """Return the index of the next line that begins in a column or left of this column."""
    rows = range(row + 1, len(lines))
    return next(
        (n for n in rows if content_of(lines[n]) and _columns(lines[n])[0] <= column), len(lines)
    )


def _indent_edits(lines: tuple[str, ...], row: int) -> Iterator[Edit]:
    """Yield edits that move a line, with the lines that belong to it, to another column."""
    now, shown = _columns(lines[row])[:2]
    columns = dict[int, str]()  # columns in which the lines above begin, with advice
    for above in reversed(range(row)):
        if not content_of(lines[above]):
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
        elif any(map(content_of, lines[row + 1 : end])):
            why += "; move the lines that belong to it, too"
        why = "tabs cannot indent; use spaces" if tabs else why
        yield Edit((row, now), "indent", why, (*lines[:row], *moved, *lines[end:]))


def _columns(line: str) -> tuple[int, str, int, str]:
    """Return the column and beginning of a line's content, and of the first key in it."""
    found = re.match(r"(\s*)((?:- +)*)([\w-]*)", line)
    assert found
    key = found[3] or found[2].strip() or line.strip()
    return len(found[1]), found[2] + found[3] or key, found.end(2), key


def _indented_by(line: str, by: int) -> str:
    margin = _columns(line)[0]
    return " " * max(0, margin + by) + line[margin:] if line.strip() else line


def content_of(line: str) -> str:
    """Return a line without its comment and the spaces before it."""
    return re.split(r"(?:^|\s)\s*#", line, maxsplit=1)[0].rstrip()


def line_before(row: int, lines: Sequence[str]) -> int:
    """Return the index of the last line with content before a line; 0 if there is none."""
    return next((above for above in reversed(range(row)) if content_of(lines[above])), 0)


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
