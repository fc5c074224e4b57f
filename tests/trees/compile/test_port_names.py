"""Ports that are given by another name."""

from pathlib import Path

from trees.compile.port_names import known_ports
from trees.declarations import Declaration
from trees.errors import Mistakes, Place
from trees.reading.document import Located

PLACE = Place(Path("20_m.yaml"))


def test_a_name_that_may_be_two_ports_is_neither() -> None:
    given = {"target": Located(PLACE, "upright", PLACE)}
    for names in (("joints", "point"), ("point", "joints")):
        known = {name: Declaration("positions") for name in names}
        assert [*known_ports(given, known, "", (), Mistakes())[0]] == []
    assert [*known_ports(given, {"arm": known["joints"]}, "", (), Mistakes())[0]] == ["arm"]


def test_ports_within_another_one_are_reported_in_the_order_of_the_file() -> None:
    known = {name: Declaration("text") for name in ("body", "size", "rotation")}
    for names in (("size", "rotation"), ("rotation", "size")):
        inner = {name: Located(PLACE, "x", PLACE) for name in (*names, "other")}
        mistakes = Mistakes()
        known_ports({"body": Located(PLACE, inner, PLACE)}, known, "port", (), mistakes)
        found = [mistake.message.partition(" ")[0] for mistake in mistakes.found]
        assert found == [*names]
