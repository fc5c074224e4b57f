"""The ROS 2 message types of a recording, and their bytes (CDR)."""

from collections.abc import Iterable
from functools import cache
from importlib import resources
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# The `.msg` files beside this one define them.
_OURS = ("arduinobot_msgs/msg/SerialFrame", "arduinobot_msgs/msg/TaskFeedback")

_NESTED = "=" * 80  # precedes each nested type in a definition


class RosTypes:
    """Message types by name: the standard types of ROS 2 Jazzy, and two of our own."""

    def __init__(self) -> None:
        """Read the standard types; takes 0.1 s."""
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._schemas: dict[str, str] = {}  # every journal needs them
        self._hashes: dict[str, str] = {}
        for name in _OURS:
            self.learn(name, _text(name))

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

    def learn(self, name: str, text: str) -> None:
        """Add a type and its nested types from a definition; known types stay.

        Raises:
            TypesysError: The text is not a definition, or contradicts a known type.
        """
        self._store.register(get_types_from_msg(text, name))


def _text(name: str) -> str:
    """Return the definition of one of our types."""
    return resources.files(__package__).joinpath(f"{name.rpartition('/')[2]}.msg").read_text()


@cache
def ros_types() -> RosTypes:
    """Return the set of types that this process shares; the first call takes 0.1 to 0.3 s."""
    return RosTypes()
