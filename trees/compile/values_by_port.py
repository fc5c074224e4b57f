"""Values of a node that a file writes without the names of the ports."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from hardware.spelling import corrections
from trees.declarations import LIST, Declaration
from trees.errors import Correction, Mistakes, Place
from trees.reading.document import REFUSED, Located, nested, scalar
from trees.reading.lines import added_below, block, key_block, replaced_block, rewritten
from trees.reading.literals import as_pairs, fit
from trees.reading.specs import Key, SkillNode, Value

from .arguments import MISSING
from .data_flow import short_name


def by_port(
    given: Mapping[str, Value],
    declared: Mapping[str, Declaration],
    named: tuple[str, str],
    wrong: Callable[..., None],
) -> Mapping[str, Value]:
    """Return values by port. Report a value that is written without its port.

    Args:
        given: Values by port, as the file has them.
        declared: The ports.
        named: Name of the node in messages, and name of the key above the values.
        wrong: Receives the place, the message and the correction.
    """
    what, key = named
    inputs = [port for port, each in declared.items() if not each.output]
    outputs = declared.keys() - inputs if isinstance(given.get(""), Key) else ()
    ports = [port for port in inputs if declared[port].needed] or inputs or [*outputs]
    whole, named_ports = as_mapping(given), declared.keys() & given.keys()
    point = [*given] == ["x", "y", "z"]
    whole = replace(whole, value=[*nested(whole).values()]) if point else whole
    if assigned := _assigned(given, declared, named, wrong):
        return assigned
    if "" not in given and (named_ports or len(ports) != 1 or not fits(whole, declared[ports[0]])):
        return given
    value = given.get("", whole)
    found = _from_pairs(value, declared, wrong) or _one_each(value, ports, named, wrong)
    if found:
        return found
    text = "" if isinstance(value, Key) else str(value.value)
    if [declared[port].type for port in ports] == ["text"]:
        value = _in_quotes(value)
    nothing = isinstance(value, Located) and value.value is None
    written = f"${short_name(value)}" if isinstance(value, Key) else value.as_yaml()
    texts = ["…" if nothing else written, *["…"] * len(ports)]
    wanted = "{" + ", ".join(map("{}: {}".format, ports, texts)) + "}"
    names = "name of its port" if len(ports) == 1 else "names of its ports"
    why = f"{what} needs the {names}: write {key}: {wanted}"
    if nothing and not any(declared[port].needed for port in ports):
        why = f"{key} has no value: leave out the colon"
    elif not ports:
        why = f"{what} has no ports: leave {written} out"
    place, is_list = value.place, not isinstance(value, Key) and isinstance(value.value, list)
    if len(ports) != 1 or nothing:
        alone = nothing and what == key and not any(declared[port].needed for port in ports)
        wrong(place, why, place.replaced(f"{key}:", key) if alone else None)
        return {port: Located(place, REFUSED, value.label) for port in ports}
    if "" in given:
        wrong(place, why, place.replaced(written, wanted) or place.replaced(text, wanted))
        return {ports[0]: value}
    if lines := block(value.label):  # a mapping over several lines
        below = [f"{ports[0]}:", *(f"  {line}" for line in lines)]
        right = replaced_block(value.label, [f"{ports[0]}: {written}"] if is_list else below)
    else:
        right = in_braces({"": value}, wanted)
    wrong(value.label, why, right)
    return {ports[0]: value}


def _assigned(
    given: Mapping[str, Value],
    declared: Mapping[str, Declaration],
    named: tuple[str, str],
    wrong: Callable[..., None],
) -> Mapping[str, Value]:
    """Report `name = value` at a node with one input and one output. Return both by port."""
    names = {each.output: port for port, each in declared.items()}
    whole = given.get("", as_mapping(given))
    text = whole.value if isinstance(whole, Located) and "" in given else None
    pairs = dict(as_pairs(text)) if isinstance(text, str) and "=" in text else {}
    if isinstance(whole, Located) and not text and not corrections(given, declared):
        pairs = {name: each.as_yaml() for name, each in nested(whole).items()}
    if not len(declared) == len(names) == 2 or len(pairs) != 1 or pairs.keys() & declared.keys():
        return {}
    ((name, written),) = pairs.items()
    wanted = f"{{{names[False]}: {written}, {names[True]}: ${name}}}"
    place, old = whole.place, str(text or "")
    right = place.replaced(old, wanted) if old else in_braces(given, wanted)
    wrong(place, f"{named[0]} needs the names of its ports: write {named[1]}: {wanted}", right)
    value = Located(place, scalar(written), whole.label)
    return {names[False]: value, names[True]: Key(place, name, whole.label)}


def _from_pairs(
    value: Value, declared: Mapping[str, Declaration], wrong: Callable[..., None]
) -> Mapping[str, Value]:
    """Report a text such as `arm = upright`. Return the values by port; empty for other values."""
    text = value.value if isinstance(value, Located) and isinstance(value.value, str) else ""
    pairs = dict(as_pairs(text)) if "=" in text else {}
    lines = block(value.place) if text else []
    if not pairs or not pairs.keys() <= declared.keys() or isinstance(value, Key):
        return {}
    place, written = value.place, ", ".join(f"{port}: {each}" for port, each in pairs.items())
    right = value.instead(f"{{{written}}}")
    if lines[1:]:  # one line for each port
        right = replaced_block(place, [f"{port}: {each}" for port, each in pairs.items()])
    why = f"a colon separates `{next(iter(pairs))}` from its value, not `=`"
    wrong(place, why, right)
    return {port: replace(value, value=scalar(each)) for port, each in pairs.items()}


def _one_each(
    value: Value, ports: Sequence[str], named: tuple[str, str], wrong: Callable[..., None]
) -> Mapping[str, Value]:
    """Report a list or several words, one for each port. Return them by port; empty otherwise."""
    items = _values(value)
    if len(items) != len(ports) or len(ports) < 2:
        return {}
    (what, key), place, given = named, value.place, dict(zip(ports, items, strict=True))
    wanted = as_mapping(given).as_yaml()
    old = place.brackets or str(value.value if isinstance(value, Located) else "")
    why = f"{what} needs the names of its ports: write {key}: {wanted}"
    wrong(place, why, place.replaced(old, wanted))
    return given


def _values(value: Value) -> list[Located]:
    """Return the items of a list, or the words and numbers in a text; empty for other values."""
    if isinstance(value, Key) or not isinstance(value.value, list | str):
        return []
    if isinstance(value.value, list):
        return value.value
    words = re.split(r"[\s,]+", value.value)
    return [replace(value, value=scalar(word)) for word in words]


def in_braces(given: Mapping[str, Value], written: str) -> Correction | None:
    """Return the line in which `written` replaces the braces around the given values."""
    label = next(iter(given.values())).label
    bracket = replace(label, column=label.column - 1)
    return bracket.replaced(bracket.brackets, written)


def with_more(
    place: Place, given: Mapping[str, Value], more: Mapping[str, str]
) -> Correction | None:
    """Return the lines of a subtree with more values at its ports.

    Args:
        place: Place of the node.
        given: Values by port.
        more: Further values by port, as YAML.
    """
    texts = [f"{port}: {text}" for port, text in more.items()]
    if not given:
        return added_below(place, f"with: {{{', '.join(texts)}}}")
    *_, last = given.values()
    if lines := key_block(last.label):
        indent = " " * (last.label.column - 1)
        text = "\n".join(f"{indent}{each}" for each in texts)
        return Correction(text, last.label.line + len(lines), 0)
    old = as_mapping(given).as_yaml()
    return in_braces(given, f"{old[:-1]}, {', '.join(texts)}}}")


def _in_quotes(value: Value) -> Value:
    """Return a number or boolean as the text in the file; return other values unchanged."""
    if isinstance(value, Located) and isinstance(value.value, int | float):
        return replace(value, value=value.as_yaml())
    return value


def as_mapping(given: Mapping[str, Value]) -> Located:
    """Return values by port as one mapping. The label of the mapping is that of the first value."""
    items = {
        port: Located(each.place, f"${each.name}", each.label) if isinstance(each, Key) else each
        for port, each in given.items()
    }
    label = next((value.label for value in items.values()), MISSING)
    return Located(label, dict(items), label)


def as_subtree(
    place: Place, skill: str, subtree: str, ports: Mapping[str, Value]
) -> Correction | None:
    """Return the correction of a subtree that is written like a skill.

    Args:
        place: Place of the node.
        skill: Name of the skill.
        subtree: Name of the subtree.
        ports: Values by port.
    """
    node = {"subtree": subtree} | ({"with": as_mapping(ports).as_yaml()} if ports else {})
    lines, old = [f"{key}: {text}" for key, text in node.items()], block(place)
    if old and old[0].startswith(skill):
        name = old[0].rstrip().endswith(f"{skill}:") or old[0].startswith(f"{skill}: ")
        rest = old[1:] if name else []
        beside = [line for line in rest if re.match(r"\w", line)]
        return replaced_block(place, [*lines, *beside])
    return rewritten(place, node) or place.replaced(skill, f"{{{', '.join(lines)}}}")


def with_port(spec: SkillNode, port: str) -> Correction | None:
    """Return the line of a skill without values, with an example time at one port."""
    alone = block(spec.place) == [spec.skill]
    return replaced_block(spec.place, [f"{spec.skill}: {{{port}: 1 s}}"]) if alone else None


def fits(value: Located, wanted: Declaration) -> bool:
    """Return True if a mapping or a list without references fits a declaration."""
    listed = isinstance(value.value, list) and wanted.type.startswith(LIST)
    if not (wanted.type == "positions" or listed) or not value.value:
        return False
    mistakes = Mistakes()
    fit(value, wanted, {}, mistakes.add)
    return not mistakes.found
