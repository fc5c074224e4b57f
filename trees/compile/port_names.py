"""Names of ports in files: misspelt and unknown names, and ports in the wrong place."""

from collections.abc import Collection, Mapping
from dataclasses import replace

from hardware.spelling import closest, corrections, there_are
from trees.declarations import Declaration
from trees.errors import Correction, Mistakes, Place
from trees.reading.document import Located, nested
from trees.reading.lines import key_block
from trees.reading.literals import fit, renamed
from trees.reading.specs import Key, Value

from .values_by_port import as_mapping, in_braces

# Names of ports in other programs.
_OTHER_NAMES = {
    "speed": {"max_velocity_scaling_factor", "velocity", "vel", "v"},
    "turn": {"rpy"},
    "choices": {"options", "answers"},
    "position": {"pose", "xyz", "center", "location"},
    "size": {"dimensions", "scale"},
}
_OTHER_MEANING = {"diameter"}  # fits the port `radius`, but its value is twice as large


def known_ports(
    given: Mapping[str, Value],
    known: Mapping[str, Declaration],
    what: str,
    joints: Collection[str],
    mistakes: Mistakes,
) -> tuple[dict[str, Value], list[Value]]:
    """Return the values of known ports, and the other values. A misspelt port counts as known.

    Args:
        given: Values by port, as in the file.
        known: The ports.
        what: Name for a port in messages; empty to report nothing.
        joints: Names of the joints of the robot.
        mistakes: Receives mistakes.
    """
    if what:
        given = _outside(_indented(given, known, mistakes), known, what, mistakes)
    likely = corrections(given, known)
    for port in known:
        words = _OTHER_NAMES.get(port, set()) & given.keys() - {*known, *likely}
        if len(words) == 1 and port not in {*given, *likely.values()}:
            likely[words.pop()] = port
    joints = {*joints} & given.keys() - known.keys()
    likely = {port: name for port, name in likely.items() if port not in joints}
    unknown = [port for port in given if port not in {*known, *likely, *_OTHER_MEANING}]
    needed = [port for port, each in known.items() if each.needed and port not in given]
    missing = [p for p in needed if p not in likely.values() and not known[p].output]
    pairs = dict(zip(unknown, missing, strict=True)) if len(unknown) == len(missing) else {}
    alone = len(pairs) == 1
    fitting = alone or all(_may_take(known[port], given[word]) for word, port in pairs.items())
    if fitting and not any(closest(word, known) for word in pairs):
        likely |= pairs
    left = [word for word in unknown if word not in likely]
    ports = {port: each for port, each in known.items() if port in missing}
    fitted = [(w, p) for w in left for p in ports if _may_take(ports[p], given[w])]
    given_to, taken = [word for word, _ in fitted], [port for _, port in fitted]
    likely |= {word: p for word, p in fitted if given_to.count(word) == taken.count(p) == 1}
    is_text = alone and known[missing[0]].type == "text"
    for port in given if what else ():
        if port not in known:
            label, name = given[port].label, likely.get(port, "")
            there = there_are(port, known, given)
            there += "" if name or missing or there.endswith("?") else "; leave it out"
            if port in joints:
                inner = (each for each, kind in known.items() if kind.type == "positions")
                there = f"{port} is a joint; write it with its angle within {next(inner, '')}"
            instead, value = label.replaced(port, name), given[port]
            if name and isinstance(value, Located):
                value, instead = renamed(port, name, value)
                given = {**given, port: value}
            if is_text and name == missing[0] and _edited(label, mistakes):  # a text with a colon
                text = as_mapping({port: given[port]}).as_yaml()[1:-1]
                quoted = Located(label, text, label).as_yaml()
                instead = label.replaced(text, f"{name}: {quoted}")
            mistakes.add(label, f"{port} is not a {what}; {there}", instead)
    named = {likely.get(port, port): value for port, value in given.items()}
    rest = [value for port, value in named.items() if port not in known]
    return {port: value for port, value in named.items() if port in known}, rest


def _may_take(declared: Declaration, value: Value) -> bool:
    """Return True if a port may take a value. Any name may be a pose."""
    if isinstance(value, Key):
        return True
    if declared.type == "positions":
        return isinstance(value.value, str | dict)
    mistakes = Mistakes()
    fit(value, declared, {}, mistakes.add)
    return not mistakes.found


def _indented(
    given: Mapping[str, Value], known: Mapping[str, Declaration], mistakes: Mistakes
) -> Mapping[str, Value]:
    """Return values by port. Move keys that are below a port without a value into this port."""
    found, inside, above = dict[str, Value](), dict[str, dict[str, Value]](), ""
    misspelt = corrections(given, known)
    for port, value in given.items():
        if port in known or port in misspelt:
            empty = isinstance(value, Located) and value.value is None
            above = port if empty and port in known and known[port].type == "positions" else ""
        if above and port != above:
            inside.setdefault(above, {})[port] = value
        else:
            found[port] = value
    for port, values in inside.items():
        head, first = given[port].label, next(iter(values.values()))
        why = f"{', '.join(values)} must be indented below {port}"
        end = max(each.label.line + len(key_block(each.label)) for each in values.values())
        lines = [*head.lines[head.line - 1 : end - 1]]
        lines[1:] = [f"  {line}" if line.strip() else line for line in lines[1:]]
        right = Correction("\n".join(lines), head.line, len(lines))
        mistakes.add(first.label, why, right if lines[1:] else None)
        found[port] = replace(as_mapping(values), label=head)
    return found


def _outside(
    given: Mapping[str, Value], known: Mapping[str, Declaration], what: str, mistakes: Mistakes
) -> dict[str, Value]:
    """Return values by port. Move ports that are written inside another port out of that port."""
    found = dict(given)
    for port, value in given.items():
        within = nested(value) if isinstance(value, Located) else {}
        for name in [each for each in within if each in known and each not in given]:
            assert isinstance(value, Located)
            rest = {each: item for each, item in within.items() if each not in known}
            if port not in known and not rest:  # such as `params: {duration: 2 s}`
                rows = [f"{each}: {item.as_yaml()}" for each, item in within.items()]
                text = "\n".join(f"{' ' * (value.label.column - 1)}{row}" for row in rows)
                lines = key_block(value.label)
                right = Correction(text, value.label.line, len(lines)) if lines else None
                left = {each: found[each] for each in found if each != port}
                right = right or in_braces(given, as_mapping({**left, **within}).as_yaml())
                why = f"{port} is not a {what}; leave out {port}, but keep the ports below it"
                mistakes.add(value.label, why, right)
                return {**left, **within}
            found[port], found[name] = replace(value, value=rest), within[name]
            why = f"{name} is a {what}; write it at the level of {port}"
            mistakes.add(within[name].label, why, in_braces(given, as_mapping(found).as_yaml()))
    return found


def _edited(place: Place, mistakes: Mistakes) -> bool:
    """Return True if the layout of a line was corrected."""
    found = [each.place for each in mistakes.found if each.place.path == place.path]
    return any(each.line == place.line and each.lines != place.lines for each in found)
