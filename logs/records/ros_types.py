"""The ROS 2 message types of a recording, and their bytes (CDR)."""

import re
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import resources
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

# Each `.msg` file beside this one defines one; `standard.msg` has those of ROS 2.
_OURS = tuple(
    f"arduinobot_msgs/msg/{name}" for name in ("SerialFrame", "TaskFeedback", "MeasuredJoints")
)

_NESTED = "=" * 80  # precedes each nested type in a definition
_ARRAY = re.compile(r"(.+)\[(\d*)\]")


class RosTypes:
    """Message types by name: those of recordings, and what they consist of.

    rosbags has all types of ROS 2, and a parser for definitions; both take 0.1 s to load.
    """

    def __init__(self) -> None:
        self._store = get_typestore(Stores.EMPTY)  # Time and Duration
        self._schemas: dict[str, str] = {}  # every journal needs them
        self._hashes: dict[str, str] = {}
        ours = "\n".join(f"MSG: {name}\n{_text(name)}" for name in _OURS)
        self._store.register(dict(_definitions(f"{_text('standard')}\n{ours}")))

    def warm_up(self, names: Iterable[str]) -> None:
        """Generate the code of types in advance; takes 2 to 7 ms each."""
        for name in names:
            self._store.get_msgdef(name)

    def make(self, name: str, /, **fields: Any) -> Any:
        """Return a message of a type; arrays of numbers are NumPy arrays."""
        return self._store.types[name](**fields)

    def encode(self, message: Any) -> bytes:
        """Return the CDR bytes of a message."""
        return bytes(self._store.serialize_cdr(message, message.__msgtype__))

    def decode(self, name: str, data: bytes) -> Any:
        """Return the message of a type from its CDR bytes.

        Raises:
            SerdeError: The bytes do not fit the type.
        """
        return self._store.deserialize_cdr(data, name)

    def schema(self, name: str) -> str:
        """Return a type's definition in `ros2msg` form with nested types; ours with comments."""
        if name not in self._schemas:
            made: str = self._store.generate_msgdef(name, ros_version=2)[0]
            if name in _OURS:
                made = _text(name) + "".join(made.partition(_NESTED)[1:])
            self._schemas[name] = made
        return self._schemas[name]

    def hash(self, name: str) -> str:
        """Return a type's hash: `RIHS01_` and 64 hexadecimal digits."""
        if name not in self._hashes:
            self._hashes[name] = self._store.hash_rihs01(name)
        return self._hashes[name]


def _definitions(text: str) -> Iterator[tuple[str, Any]]:
    """Yield each type of a text with its constants and fields, as rosbags has them.

    Args:
        text: Definitions, each after a line `MSG: ` with the name of its type.
    """
    for definition in text.split("MSG: ")[1:]:
        name, _, lines = definition.partition("\n")
        constants, fields = [], []
        for line in filter(None, (line.partition("#")[0].strip() for line in lines.split("\n"))):
            kind, field = line.split()
            constant, _, value = field.partition("=")
            if value:
                constants.append((constant, kind, int(value)))
            else:
                fields.append((field, _kind(kind)))
        yield name, (constants, fields)


def _kind(kind: str) -> tuple[Any, Any]:
    """Return the type of a field, such as `string`, `float64[]` or `std_msgs/Header`."""
    if array := _ARRAY.fullmatch(kind):
        node = Nodetype.ARRAY if array[2] else Nodetype.SEQUENCE
        return node, (_kind(array[1]), int(array[2] or 0))
    if "/" in kind:
        return Nodetype.NAME, kind.replace("/", "/msg/")
    return Nodetype.BASE, (kind, 0)


def _text(name: str) -> str:
    """Return the content of the file of a type."""
    return resources.files(__package__).joinpath(f"{name.rpartition('/')[2]}.msg").read_text()


@cache
def ros_types() -> RosTypes:
    """Return the set of types that this process shares; the first call is slow."""
    return RosTypes()
