"""What a task file may write at a skill's port: the skill's declaration in the grammar's words."""

from typing import Any

from py_trees.ports import PortInformation, get_ports_registry

from skills import Port, Positions, Skill
from trees import ANY, Declaration

from .plugins import is_broken

_TYPES: dict[Any, str] = {
    float: "number",
    int: "integer",
    bool: "boolean",
    str: "text",
    Positions: "positions",
    object: ANY,
}
_UNITS = {"": "number", "rad": "angle", "s": "duration", "m": "length"}


def known_skills() -> dict[str, type[Skill]]:
    """The skills there are, by name."""
    registry = get_ports_registry().items()
    return {
        name: kind
        for name, kind in registry
        if issubclass(kind, Skill) and not is_broken(kind.__module__)
    }


def declaration(port: PortInformation, output: bool = False) -> Declaration:
    """A port as the grammar declares it."""
    kind = _TYPES.get(port.data_type) or str(getattr(port.data_type, "__name__", "value"))
    if not isinstance(port, Port):
        return Declaration(
            kind,
            default=port.default_value,
            optional=not port.required,
            output=output,
            description=port.description,
        )
    return Declaration(
        _UNITS[port.unit] if port.data_type is float else kind,
        default=port.default_value,
        optional=not port.required,
        least=port.least,
        most=port.most,
        choices=port.choices,
        output=output,
        description=port.description,
    )


def declarations(kind: type[Skill]) -> dict[str, Declaration]:
    """All ports of a skill, inputs first."""
    inputs = {name: declaration(port) for name, port in kind.input_ports().items()}
    outputs = {name: declaration(port, True) for name, port in kind.output_ports().items()}
    return inputs | outputs


def port_value(fitted: Any) -> Any:
    """A value that fits a declaration, as skills take it."""
    return Positions(fitted) if isinstance(fitted, dict) else fitted
