"""The keys of a blackboard, followed through a tree before it runs: written before read, and once.

What is known at a node is what every way to it has written.
"""

from dataclasses import dataclass, field

from trees.reading.node_parser import Mistakes
from trees.reading.specs import Key
from trees.reading.values import type_fits, words

_OR = " | "  # between the types of a key that has one or another


@dataclass
class Keys:
    """What is on the blackboard when a node begins.

    Attributes:
        written: The type of every key that is there for certain, by full name.
        unread: Where a key was written that nothing has read since.
    """

    written: dict[str, str] = field(default_factory=dict)
    unread: dict[str, Key] = field(default_factory=dict)

    def copy(self) -> "Keys":
        """The same, to be changed apart."""
        return Keys(dict(self.written), dict(self.unread))

    def read(self, key: Key, wanted: str, what: str, mistakes: Mistakes) -> str:
        """A port reads a key.

        Args:
            key: Which.
            wanted: The type that it must have.
            what: The port, in words.
            mistakes: Told what is wrong.

        Returns:
            The type that the key has; empty where nothing has written it, or nobody knows what.
        """
        name, written = short(key), self.written.get(key.name, "")
        self.unread.pop(key.name, None)
        if not written:
            mistakes.add_last(key.place, f"nothing has written ${name} when {what} reads it")
        elif _OR in written:
            kinds = " or ".join(map(words, written.split(_OR)))
            why = f"{what}: ${name} is {kinds}, by the way that was taken before"
            mistakes.add_last(key.place, why)
            return ""
        elif not type_fits(written, wanted):
            why = f"{what}: ${name} is {words(written)}, not {words(wanted)}"
            mistakes.add_last(key.place, why)
        return written

    def write(self, key: Key, kind: str, mistakes: Mistakes) -> None:
        """A port writes a key of a type."""
        if before := self.unread.get(key.name):
            line = before.place.line
            mistakes.add(
                key.place,
                f"${short(key)} is written a second time; what line {line} writes nothing reads",
            )
        self.written[key.name], self.unread[key.name] = kind, key

    def join(self, ways: list["Keys"]) -> None:
        """Go on after one of several ways, nobody knows which."""
        certain = set.intersection(*(set(way.written) for way in ways))
        self.written = {
            name: _either([way.written[name] for way in ways])
            for name in ways[0].written
            if name in certain
        }
        self.unread = {}

    def gather(self, ways: list["Keys"], mistakes: Mistakes) -> None:
        """Go on after several ways that were gone side by side."""
        for way in ways:
            for name, key in way.unread.items():
                other = self.unread.get(name)
                if other and other is not key and name not in _same(self.unread, way.unread):
                    mistakes.add(
                        key.place,
                        f"${short(key)} is written beside line {other.place.line}, which writes it "
                        "too, so that nobody knows which comes last",
                    )
                self.unread[name] = key
            self.written |= way.written


def _either(kinds: list[str]) -> str:
    """The type of a key that has one of several."""
    one = next((kind for kind in kinds if all(type_fits(other, kind) for other in kinds)), "")
    return one or _OR.join(sorted({kind for each in kinds for kind in each.split(_OR)}))


def _same(first: dict[str, Key], second: dict[str, Key]) -> set[str]:
    return {name for name in first if first[name] is second.get(name)}


def short(key: Key) -> str:
    """A key as the file calls it."""
    return key.name.rpartition("/")[2]
