"""What `$name` means: a parameter, a port of the subtree, or a key of the blackboard."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from trees.declarations import Declaration
from trees.errors import Place
from trees.reading.document import Located, StandIn
from trees.reading.grammar import UNTYPED
from trees.reading.specs import Key, Value


@dataclass(frozen=True)
class Scope:
    """Names within one file.

    Attributes:
        namespace: Of its own keys.
        ports: What it was given.
        within: The files around it, and itself.
        stand_ins: Keys of which the value is given only when a task is called, by full name.
        fixed: Names that nothing may write, and what they are.
    """

    namespace: str
    ports: Mapping[str, Value] = field(default_factory=dict)
    within: tuple[str, ...] = ()
    stand_ins: Mapping[str, StandIn] = field(default_factory=dict)
    fixed: Mapping[str, str] = field(default_factory=dict)


def fixed(declared: Mapping[str, Declaration], what: str) -> dict[str, str]:
    """The parameters or ports that nothing may write, and what they are."""
    why = {
        "parameter": "a parameter, which nothing may write",
        "port": "a port that is read; say output: true where it is declared",
    }
    names = (name for name, each in declared.items() if each.type != UNTYPED and not each.output)
    return dict.fromkeys(names, why[what])


def resolve(value: Value, scope: Scope, wrong: Callable[[Place, str], None]) -> Value:
    """What a value means outside its file.

    Args:
        value: As the file has it.
        scope: Of that file.
        wrong: Told what is wrong.

    Returns:
        A literal without names, or a key with its full name.
    """
    if isinstance(value, Located):
        return _without_names(value, scope, wrong)
    given = scope.ports.get(value.name)
    if isinstance(given, Located):
        return Located(given.place, given.value, value.label)
    return given or Key(value.place, f"{scope.namespace}/{value.name}", value.label)


def _without_names(
    value: Located, scope: Scope, wrong: Callable[[Place, str], None], inside: bool = False
) -> Located:
    """A literal with the names inside it replaced by what they stand for."""
    inner = value.value
    if isinstance(inner, dict):
        items = {key: _without_names(item, scope, wrong, True) for key, item in inner.items()}
        return Located(value.place, items, value.label)
    if isinstance(inner, list):
        rows = [_without_names(item, scope, wrong, True) for item in inner]
        return Located(value.place, rows, value.label)
    if not inside or not isinstance(inner, str) or not inner.startswith("$"):
        return value
    given = scope.ports.get(inner[1:])
    key = given.name if isinstance(given, Key) else f"{scope.namespace}/{inner[1:]}"
    if key in scope.stand_ins:
        return Located(value.place, scope.stand_ins[key], value.label)
    if isinstance(given, Located):
        return Located(given.place, given.value, value.label)
    wrong(
        value.place,
        f"{inner} has no value before the run; within a mapping or a list stand values, and "
        "parameters or ports that are given one",
    )
    return Located(value.place, None, value.label)
