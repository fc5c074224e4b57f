"""JSON from the network: what Python's reader accepts and ours refuses."""

import json

import pytest
from hypothesis import given, strategies as st

from executive.api.strict_json import NotJson, parse

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)  # fmt: skip


@given(JSON)
def test_json_is_read(value: object) -> None:
    assert parse(json.dumps(value)) == value
    assert parse(json.dumps(value, ensure_ascii=False).encode()) == value


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"NaN", "NaN"),
        (b'{"a": -Infinity}', "Infinity"),
        (b"[1e999]", "1e999"),
        (b'{"task": 1, "task": 2}', "'task' is given twice"),
        (b'{"a": {"b": 1, "b": 1}}', "'b' is given twice"),
        (b"[" * 60_000, "too deep"),
        (b'{"a":' * 10_000, "too deep"),
        (b'"\\ud800"', "surrogates"),
        (b'"\xff"', "utf-8"),
        ('"ä"'.encode("utf-16"), "utf-8"),
        (b"9" * 5000, "digits"),
        (b"", "Expecting value"),
        (b"{'a': 1}", "Expecting property name"),
        (b"1 2", "Extra data"),
    ],
)
def test_ambiguous_or_invalid_json_is_refused(text: bytes, why: str) -> None:
    with pytest.raises(NotJson, match=why):
        parse(text)


@given(st.binary())
def test_no_other_error_is_raised(data: bytes) -> None:
    try:
        parse(data)
    except NotJson:
        return
