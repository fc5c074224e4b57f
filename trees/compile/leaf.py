"""A skill in a tree that is being compiled, and its inputs as far as they are known."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skills import Positions, Skill
from trees.errors import Place
from trees.reading.document import Located, StandIn


@dataclass(frozen=True)
class Leaf:
    """A skill, and the values and keys at its ports.

    Attributes:
        skill: The skill.
        place: Its place in a file.
        namespace: Namespace of its keys.
        keys: Full names of keys, by port.
        inputs: Literal values by port; a part that is not known yet is a StandIn.
        written: The same values as the file has them.
    """

    skill: Skill
    place: Place
    namespace: str
    keys: Mapping[str, str]
    inputs: Mapping[str, Any]
    written: Mapping[str, Located]

    @property
    def known(self) -> Mapping[str, Any]:
        """The inputs that are completely known before the task is called, by port."""
        defaults = {
            port: info.default_value
            for port, info in type(self.skill).input_ports().items()
            if info.default_value is not None and port not in self.keys
        }
        given = {**defaults, **self.inputs}
        return {port: value for port, value in given.items() if not _is_partial(value)}

    @property
    def partial(self) -> Mapping[str, Any]:
        """The known parts of inputs that are partly known before the task is called, by port."""
        parts = {port: _part(value) for port, value in self.inputs.items() if _is_partial(value)}
        return {port: value for port, value in parts.items() if value is not None}

    @property
    def target_place(self) -> Place:
        """The place of its first joint positions, or its own place if it has none."""
        targets = (
            value.place
            for port, value in self.written.items()
            if isinstance(self.inputs[port], Positions)
        )
        return next(targets, self.place)


def _is_partial(value: Any) -> bool:
    """Return whether a value, or a value in it, is not known yet."""
    if isinstance(value, Mapping):
        return any(map(_is_partial, value.values()))
    return any(map(_is_partial, value)) if isinstance(value, list) else isinstance(value, StandIn)


def _part(value: Any) -> Any:
    """Return the known part of a value, or None."""
    if isinstance(value, list):
        return [_part(item) for item in value]
    if not isinstance(value, Positions):
        return None if isinstance(value, StandIn) else value
    part = Positions((name, q) for name, q in value.items() if not isinstance(q, StandIn))
    part.unknown = tuple(name for name in value if name not in part)
    return part
