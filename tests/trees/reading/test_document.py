"""YAML as strict as it is meant: YAML 1.2 values, one meaning, and a place for every mistake."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from trees import FileError, Mistake, Place
from trees.reading.document import MAX_BYTES, MAX_DEPTH, MAX_MISTAKES, read_text
from trees.reading.grammar import parse_value

FILE = Path("x.yaml")


def read(text: str) -> Any:
    return parse_value(text, str(FILE)).plain()


MEANINGS = [
    ("010", 10),
    ("0o17", 15),
    ("0x1F", 31),
    ("-0", 0),
    ("+5", 5),
    ("1e3", 1000.0),
    (".5", 0.5),
    ("5.", 5.0),
    ("1.", 1.0),
    ("-.inf", -math.inf),
    ("null", None),
    ("~", None),
    ("", None),
    ("true", True),
    ("False", False),
    ("tRUE", "tRUE"),
    # What only YAML 1.1 takes for something else.
    ("off", "off"),
    ("yes", "yes"),
    ("n", "n"),
    ("1:30", "1:30"),
    ("1_000", "1_000"),
    ("0b11", "0b11"),
    ("2026-01-01", "2026-01-01"),
    ("=", "="),
    ("<<", "<<"),
    ("1e", "1e"),
    ("0o8", "0o8"),
    ("+.nan", "+.nan"),
    ("'1'", "1"),
    ('"true"', "true"),
    ("!x".replace("!", ""), "x"),
]


@pytest.mark.parametrize(("text", "value"), MEANINGS)
def test_a_scalar_means_what_yaml_1_2_says(text: str, value: object) -> None:
    found = read(f"a: {text}\n")["a"]
    assert (type(found), found) == (type(value), value)


def test_nan() -> None:
    assert math.isnan(read("a: .nan")["a"])


def test_a_merge_key_is_a_key_like_any_other() -> None:
    assert read("a: {<<: {b: 1}}") == {"a": {"<<": {"b": 1}}}


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends(end: str) -> None:
    document = parse_value(end.join(["a: 1", "", "b:", "  - 2", ""]), str(FILE))
    assert document.plain() == {"a": 1, "b": [2]}
    assert isinstance(document.value, dict)
    b = document.value["b"]
    assert (b.label, b.place) == (Place(FILE, 3, 1), Place(FILE, 4, 3))


def test_a_byte_order_mark() -> None:
    assert read("\ufeffa: 1") == {"a": 1}


WRONG = [
    ("", 1, 1, "the file is empty"),
    ("# nothing\n", 2, 1, "the file is empty"),
    ("a: 1\n---\nb: 2\n", 2, 1, "a second document"),
    ("a: 1\n...\n---\nb: 2\n", 3, 1, "a second document"),
    ("a: 1\nb: 2\na: 3\n", 3, 1, "the key a is given twice"),
    ("a: {b: 1, 'b': 2}\n", 1, 11, "the key b is given twice"),
    ("a: 1\n'1': 2\n1: 2\n", 3, 1, "the key 1 is given twice"),
    ("? [a]\n: 1\n", 1, 3, "the key [a] is not a text"),
    ("? {a: 1}\n: 1\n", 1, 3, "is not a text"),
    ("~: 1\n", 1, 1, "the key null is not a text"),
    ("a: &x 1\nb: *x\n", 2, 4, "alias"),
    ("a: &x [1]\nb: *x\n", 2, 4, "alias"),
    ("a: &a\n  b: *a\n", 2, 6, "alias"),
    ("a: !!python/object/apply:os.system [ls]\n", 1, 4, "tags are not allowed"),
    ("a: !!python/name:os.system\n", 1, 4, "tags are not allowed"),
    ("a: !!int ''\n", 1, 4, "tags are not allowed"),
    ("a: !!bool x\n", 1, 4, "tags are not allowed"),
    ("a: !!set {b}\n", 1, 4, "tags are not allowed"),
    ("!x\na: 1\n", 1, 1, "tags are not allowed"),
    ("%YAML 1.1\n---\na: off\n", 1, 1, "directives are not allowed"),
    ("# x\n%YAML 1.3\n---\na: 1\n", 2, 1, "directives are not allowed"),
    ("%TAG ! tag:x,2000:\n---\na: 1\n", 1, 1, "directives are not allowed"),
    ("a:\n\tb: 1\n", 2, 1, "YAML does not allow this here"),
    ("\ta: 1\n", 1, 1, "YAML does not allow this here"),
    ("a: 'b\n", 2, 1, "the ' of line 1, column 4 is not closed"),
    ("a: {b: 1\n", 2, 1, "the { of line 1, column 4 is not closed"),
    ("a: [1, 2\nb: 1\n", 2, 2, "the [ of line 1, column 4 is not closed"),
    ("a: b: c\n", 1, 5, "YAML does not allow this here"),
    ("a: @b\n", 1, 4, "YAML does not allow this here"),
    ("a: 1\n b: 2\n", 2, 3, ""),
    ("a: \x07\n", 1, 4, "the character '\\x07' is not allowed"),
    ("a: 1\x85b: 2\n", 1, 5, "'\\x85'"),
    ("a: 1\u2028b: 2\n", 1, 5, "'\\u2028'"),
    ("a: \ud800\n", 1, 4, "'\\ud800'"),
    ('a: "\\ud800"\n', 1, 4, "'\\ud800'"),
    ('a: "\\e[2J"\n', 1, 4, "'\\x1b'"),
    ("a: \u202ex\n", 1, 4, "'\\u202e'"),
    ("a: " + "9" * 5000, 1, 4, "this number has more than 32 digits"),
    ("a: " + "0." + "0" * 5000, 1, 4, "this number has more than 32 digits"),
    ("a: " + "x" * 5000, 1, 4, "this text has more than 1000 characters"),
    ("[" * 100_000, 1, MAX_DEPTH + 2, "nested deeper than"),
    ("- " * 100_000, 1, 2 * MAX_DEPTH + 3, "nested deeper than"),
    ("#" * (MAX_BYTES + 1), 1, 1, "longer than"),
]


@pytest.mark.parametrize(("text", "line", "column", "words"), WRONG, ids=range(len(WRONG)))
def test_what_is_wrong_has_its_place(text: str, line: int, column: int, words: str) -> None:
    with pytest.raises(FileError) as caught:
        read(text)
    (mistake,) = caught.value.mistakes
    assert words in mistake.message
    assert (mistake.place.line, mistake.place.column) == (line, column)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    "text", ['"\\ud800": 1\n', 'a: {"\\e[2J": [1, "\\e"]}\n', '"\\ud800": *x\n']
)
def test_what_is_reported_of_an_odd_key_can_be_printed(text: str) -> None:
    with pytest.raises(FileError) as caught:
        read(text)
    for mistake in caught.value.mistakes:
        assert mistake.place.location.isprintable()
        assert str(mistake).replace("\n", "").isprintable()


def test_json_is_yaml_and_its_two_escapes_are_one_character() -> None:
    assert read(json.dumps({"\U0001f44d": ["\U0001f44d"]})) == {"\U0001f44d": ["\U0001f44d"]}


ANY = st.recursive(
    st.none() | st.text(st.characters()) | st.integers(),
    lambda below: st.lists(below) | st.dictionaries(st.text(st.characters()), below),
)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(ANY)
def test_any_json_is_read_or_refused_in_words_that_can_be_written(value: Any) -> None:
    reported = ""
    try:
        read(json.dumps(value))
    except FileError as error:
        reported = str(error)
    reported.encode("utf-8")  # else UnicodeEncodeError


def test_of_what_is_too_long_the_middle_is_left_out() -> None:
    endless = "x" * 60_000
    mistake = Mistake(Place(Path(endless), 0, 0, endless), f"no {endless}; there are a, b")
    assert len(str(mistake)) < 1000
    assert str(mistake).endswith("; there are a, b")


def test_a_mistake_is_one_line_for_any_name() -> None:
    mistake = Mistake(Place(Path("argument a\nINFO all is well"), 0, 0), "no \x1b[2J")
    assert str(mistake) == "argument a?INFO all is well: no ?[2J"


def test_too_many_mistakes_end_the_check() -> None:
    with pytest.raises(FileError) as caught:
        read("{" + ":," * 100_000 + "}")
    reported = [mistake.message for mistake in caught.value.mistakes]
    assert len(reported) == MAX_MISTAKES + 1
    assert "1000 mistakes so far; the rest of the file is not read" in reported


@settings(max_examples=300, deadline=None)
@given(st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        read(text)
    except FileError:
        return


YAMLISH = st.lists(
    st.sampled_from([*"abc01 -:,[]{}#&*!|>'\"%@`~?\n", "\n  ", "- ", ": ", "--- ", "<<", "!!int "])
)


@pytest.mark.slow
@settings(max_examples=500, deadline=None)
@given(YAMLISH.map("".join))
def test_what_looks_like_yaml_is_read_or_refused(text: str) -> None:
    try:
        read(text)
    except FileError:
        return


def test_files_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "3_x.yaml"
    path.write_bytes(b"a: 1\nb: \xff\n")
    with pytest.raises(FileError, match=r"3_x.yaml:2:4: is not UTF-8 text"):
        read_text(path)
    path.write_text("a: 1\n", encoding="utf-16")
    with pytest.raises(FileError, match=r"3_x.yaml:1:1: is not UTF-8 text"):
        read_text(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    import os

    folder, loop, pipe, zero = (tmp_path / name for name in ("a", "b", "c", "d"))
    folder.mkdir()
    loop.symlink_to(loop)
    os.mkfifo(pipe)
    zero.symlink_to("/dev/zero")
    for path in (folder, loop, pipe, zero, tmp_path / "none"):
        with pytest.raises(FileError, match=f"{path.name}:1:1: "):
            read_text(path)


def test_a_file_of_any_length_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "long.yaml"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(FileError, match=r"long.yaml:1:1: cannot be read: it is larger than"):
        read_text(path)
