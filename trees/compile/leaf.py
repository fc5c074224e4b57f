"""A skill of a tree that is being put together, and what is known of its inputs before the run."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skills import Positions, Skill
from trees.errors import Place
from trees.reading.document import Located, StandIn


@dataclass(frozen=True)
class Leaf:
    """A skill and what its ports are wired to.

    Attributes:
        skill: Which.
        place: Where it stands.
        namespace: Of its keys.
        keys: Full names of keys, by port.
        inputs: Values that are spelled out, by port; what is not known in them is a StandIn.
        written: The same as they are written.
    """

    skill: Skill
    place: Place
    namespace: str
    keys: Mapping[str, str]
    inputs: Mapping[str, Any]
    written: Mapping[str, Located]

    @property
    def known(self) -> Mapping[str, Any]:
        """The inputs of which the whole value is known before the task is called."""
        defaults = {
            port: info.default_value
            for port, info in type(self.skill).input_ports().items()
            if info.default_value is not None and port not in self.keys
        }
        given = {**defaults, **self.inputs}
        return {port: value for port, value in given.items() if not _stands_in(value)}

    @property
    def partly(self) -> Mapping[str, Any]:
        """The inputs of which a part is known before the task is called."""
        parts = {port: _part(value) for port, value in self.inputs.items() if _stands_in(value)}
        return {port: value for port, value in parts.items() if value is not None}


def _stands_in(value: Any) -> bool:
    """Whether a value, or one within it, is not known yet."""
    if isinstance(value, Mapping):
        return any(map(_stands_in, value.values()))
    return any(map(_stands_in, value)) if isinstance(value, list) else isinstance(value, StandIn)


def _part(value: Any) -> Any:
    """What is known of a value; None for nothing."""
    if isinstance(value, list):
        return [_part(item) for item in value]
    if not isinstance(value, Positions):
        return None if isinstance(value, StandIn) else value
    part = Positions((name, q) for name, q in value.items() if not isinstance(q, StandIn))
    part.unknown = tuple(name for name in value if name not in part)
    return part
