"""Data flow: the keys that are written when a node starts, and their types.

A key counts as written if every path through the tree to the node writes it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from hardware.spelling import suggestion
from trees.declarations import type_fits, words
from trees.errors import Mistakes
from trees.reading.specs import Key

_OR = " | "  # separates the types of a key that depends on the path


@dataclass
class Keys:
    """The keys on the blackboard when a node starts.

    Attributes:
        written: Type of every key that is certainly written, by full name.
        unread: Keys that were written and not read since, by full name.
        writes: All keys that any node writes, by full name; the same for all copies.
        reads: Full names of all keys that any node reads; the same for all copies.
    """

    written: dict[str, str] = field(default_factory=dict)
    unread: dict[str, Key] = field(default_factory=dict)
    writes: dict[str, Key] = field(default_factory=dict)
    reads: set[str] = field(default_factory=set)

    def copy(self) -> "Keys":
        """Return a copy that can be changed independently."""
        return Keys(dict(self.written), dict(self.unread), self.writes, self.reads)

    def never_read(self) -> list[Key]:
        """Return the keys that nodes write but no node reads."""
        return [key for name, key in self.writes.items() if name not in self.reads]

    def read(
        self, key: Key, wanted: str, what: str, mistakes: Mistakes, writers: Sequence[str] = ()
    ) -> str:
        """Check and record that a port reads a key.

        Args:
            key: The key.
            wanted: Type that the port accepts.
            what: Name of the port, for messages.
            mistakes: Receives mistakes.
            writers: Names of skills that can write the key, for messages.

        Returns:
            The type of the key; empty if the key is not written, or if its type is uncertain.
        """
        name, written = short_name(key), self.written.get(key.name, "")
        self.unread.pop(key.name, None)
        self.reads.add(key.name)
        if not written:
            there = [other for other in self.written if other.startswith(key.name[: -len(name)])]
            near = suggestion(name, [other.rpartition("/")[2] for other in there])
            why = "; write the key in an earlier node"
            why += f", such as {' or '.join(writers)}" if writers else ""
            why += ", or declare a parameter or port of this name"
            mistakes.add_last(
                key.place, f"nothing has written ${name} when {what} reads it{near or why}"
            )
        elif _OR in written:
            kinds = " or ".join(map(words, written.split(_OR)))
            why = f"{what}: ${name} is {kinds}, depending on the path taken before"
            mistakes.add_last(key.place, why)
            return ""
        elif not type_fits(written, wanted):
            why = f"{what}: ${name} is {words(written)}, not {words(wanted)}"
            mistakes.add_last(key.place, why)
        return written

    def write(self, key: Key, kind: str, mistakes: Mistakes) -> None:
        """Check and record that a port writes a key of a type."""
        if before := self.unread.get(key.name):
            line = before.place.line
            mistakes.add(
                key.place,
                f"${short_name(key)} is written again, but no node reads the value that line "
                f"{line} writes",
            )
        self.written[key.name], self.unread[key.name] = kind, key
        self.writes.setdefault(key.name, key)

    def merge_alternatives(self, branches: list["Keys"]) -> None:
        """Merge the keys of alternative branches. A key is certain if every branch writes it."""
        certain = set.intersection(*(set(branch.written) for branch in branches))
        self.written = {
            name: _common_type([branch.written[name] for branch in branches])
            for name in branches[0].written
            if name in certain
        }
        self.unread = {}

    def merge_parallel(self, branches: list["Keys"], mistakes: Mistakes) -> None:
        """Merge the keys of branches that run at the same time."""
        for branch in branches:
            for name, key in branch.unread.items():
                other = self.unread.get(name)
                if other and other is not key:
                    mistakes.add(
                        key.place,
                        f"${short_name(key)} is also written by line {other.place.line}, at the "
                        "same time; give the two keys different names",
                    )
                self.unread[name] = key
            self.written |= branch.written


def _common_type(kinds: list[str]) -> str:
    """Return a type that accepts several types; else the types, joined with `_OR`."""
    one = next((kind for kind in kinds if all(type_fits(other, kind) for other in kinds)), "")
    return one or _OR.join(sorted({kind for each in kinds for kind in each.split(_OR)}))


def short_name(key: Key) -> str:
    """Return the name of a key without its namespace."""
    return key.name.rpartition("/")[2]
