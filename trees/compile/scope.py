"""The meaning of `$name`: a parameter, a port of the subtree, or a key of the blackboard."""

from collections.abc import Collection, Mapping
from dataclasses import replace

from hardware.loading.dataclass import dataclass
from hardware.spelling import closest, suggestion
from trees.errors import Correction, Mistakes, Place
from trees.reading.document import REFUSED, Located, StandIn, calculates, reference
from trees.reading.grammar import TaskFile
from trees.reading.lines import declared_above
from trees.reading.specs import Key, Value


@dataclass(frozen=True, slots=True)
class Scope:
    """The names in one file.

    Attributes:
        file: The file.
        namespace: Namespace of its keys.
        ports: Values of its ports or parameters.
        within: Places that use this file and the files around it, by name of the used file.
        stand_ins: Placeholders for parameters of the task, and for ports without a value, by full
            name of the key.
    """

    file: TaskFile
    namespace: str
    ports: Mapping[str, Value]
    within: Mapping[str, Place]
    stand_ins: Mapping[str, StandIn]


def resolve(value: Value, scope: Scope, written: Collection[str], mistakes: Mistakes) -> Value:
    """Replace the references in a value by their values or keys.

    Args:
        value: A value or a reference in a file.
        scope: Scope of that file.
        written: Full names of the keys that earlier nodes write.
        mistakes: Receives mistakes.

    Returns:
        A literal without references, or a key with its full name.
    """
    if isinstance(value, Located):
        return _without_names(value, scope, written, mistakes)
    given = scope.ports.get(value.name)
    if isinstance(given, Located):
        return _used(given, value, scope.stand_ins.get(f"{scope.namespace}/{value.name}"))
    return given or Key(value.place, f"{scope.namespace}/{value.name}", value.label)


def _used(given: Located, user: Value, stand_in: StandIn | None) -> Located:
    """Return the value of a parameter or port at a place that uses it."""
    use = Located(user.place, stand_in, user.label) if stand_in else given.use
    return Located(given.place, given.value, user.label, use)


def _without_names(
    value: Located, scope: Scope, written: Collection[str], mistakes: Mistakes, kind: str = ""
) -> Located:
    """Return a literal with the references inside it replaced by their values.

    `kind` is the likely type of a value inside another value; else empty.
    """
    inner = value.value

    def within(item: Located, kind: str) -> Located:
        return _without_names(item, scope, written, mistakes, kind)

    if isinstance(inner, dict):
        return replace(value, value={key: within(item, "angle") for key, item in inner.items()})
    if isinstance(inner, list):
        return replace(value, value=[within(item, "number") for item in inner])
    if not kind or not isinstance(inner, str) or inner[:1] != "$" or calculates(inner):
        return value
    what = scope.file.port
    name = _as_here(value, inner, scope, mistakes)
    given = scope.ports.get(name[1:])
    key = given.name if isinstance(given, Key) else f"{scope.namespace}/{name[1:]}"
    stand_in = scope.stand_ins.get(key)
    if isinstance(given, Located):
        return _used(given, value, stand_in)
    if stand_in:
        return replace(value, value=stand_in)
    near = suggestion(name[1:], scope.file.parameters)
    why, lines = f"there is no {what} for {name}{near}", None
    if near:
        lines = value.place.replaced(name, f"${closest(name[1:], scope.file.parameters)}")
    if key in written:
        why = f"{inner} has no value before the run; a mapping or a list may contain values, and "
        why += "parameters or ports that have a value"
    elif not near:
        more, lines = _undeclared(value.place, what, name, kind)
        why += more
    mistakes.add_last(value.place, why, lines)
    return replace(value, value=REFUSED)


def _as_here(value: Located, name: str, scope: Scope, mistakes: Mistakes) -> str:
    """Return `$name`. Report a wrong form of a reference, such as `$(arg name)`."""
    meant, what = reference(name), scope.file.port
    if meant:
        more = "" if meant[1:] in scope.file.parameters else f", and declare it with {what}s:"
        why = f"write {meant} for a {what}, not {name}{more}"
        mistakes.add_last(value.place, why, value.instead(meant))
    return meant or name


def _undeclared(place: Place, what: str, name: str, kind: str) -> tuple[str, Correction | None]:
    """Return advice for `$name` without a declaration, and the line that declares the name."""
    if not name[1:].isidentifier():  # a value such as $20 deg
        return "; leave out the $", place.replaced(name, name[1:])
    line = f"{name[1:]}: {{type: {kind}, default: 0}}"
    advice = f"; declare it above the tree, with {what}s:, or write a value here"
    return advice, declared_above(place, f"{what}s", line)
