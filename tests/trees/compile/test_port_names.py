"""Ports that are given by another name."""

from pathlib import Path

from trees.compile.port_names import known_ports
from trees.declarations import Declaration
from trees.errors import Mistakes, Place
from trees.reading.document import Located


def test_a_name_that_may_be_two_ports_is_the_first_one() -> None:
    """A set of names has another order in each process."""
    place = Place(Path("20_m.yaml"))
    given = {"target": Located(place, "upright", place)}
    for names in (("joints", "point"), ("point", "joints")):
        known = {name: Declaration("positions") for name in names}
        assert [*known_ports(given, known, "", (), Mistakes())[0]] == [names[0]]
