"""A skill in a tree during compilation, with the known part of its inputs."""

from collections.abc import Mapping
from typing import Any

from hardware.loading.dataclass import dataclass
from skills import Positions, Skill
from trees.errors import Place
from trees.reading.document import Located, StandIn


@dataclass(frozen=True, slots=True)
class Leaf:
    """A skill, and the values and keys at its ports.

    Attributes:
        skill: The skill.
        place: Its place in a file.
        namespace: Namespace of its keys.
        keys: Full names of keys, by port.
        inputs: Converted literal values by port. An unknown part is a StandIn.
        written: The same values as they are in the file, by port.
    """

    skill: Skill
    place: Place
    namespace: str
    keys: Mapping[str, str]
    inputs: Mapping[str, Any]
    written: Mapping[str, Located]

    @property
    def known(self) -> Mapping[str, Any]:
        """Inputs that are completely known before the run, by port."""
        defaults = {
            port: info.default_value
            for port, info in type(self.skill).input_ports().items()
            if info.default_value is not None and port not in self.keys
        }
        given = {**defaults, **self.inputs}
        return {port: value for port, value in given.items() if not _is_partial(value)}

    @property
    def partial(self) -> Mapping[str, Any]:
        """Known parts of inputs that are partly known before the run, by port."""
        parts = {port: _part(value) for port, value in self.inputs.items() if _is_partial(value)}
        return {port: value for port, value in parts.items() if value is not None}

    @property
    def target_place(self) -> Place:
        """Place of the first joint positions; place of the skill if it has no joint positions."""
        targets = [port for port in self.written if isinstance(self.inputs[port], Positions)]
        return self.written[targets[0]].place if targets else self.place


def _is_partial(value: Any) -> bool:
    """Return True if a value, or a value in it, is not known yet."""
    if isinstance(value, Mapping):
        return any(map(_is_partial, value.values()))
    return any(map(_is_partial, value)) if isinstance(value, list) else isinstance(value, StandIn)


def _part(value: Any) -> Any:
    """Return the known part of a value; None if no part is known."""
    if isinstance(value, list):
        return [_part(item) for item in value]
    if not isinstance(value, Positions):
        return None if isinstance(value, StandIn) else value
    part = Positions((name, q) for name, q in value.items() if not isinstance(q, StandIn))
    part.unknown = tuple(name for name in value if name not in part)
    return part
