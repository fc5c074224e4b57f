"""Differences between the messages of one record."""

import pytest

from logs.reading.consistency import _difference


@pytest.mark.parametrize("names", [("one", "other"), ("other", "one")])
def test_the_first_field_that_differs_is_named(names: tuple[str, str]) -> None:
    found, expected = (
        "{{{}}}".format(", ".join(f'"{name}": {value}' for name in names)) for value in (1, 2)
    )
    assert _difference(".text", found, expected) == f"text.{names[0]} is 1, its record has 2"
