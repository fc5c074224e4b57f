"""Reading of literal values: converts text with units to the declared type."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeGuard

from hardware import DISPLAY_UNITS
from hardware.printable import plural
from hardware.spelling import choices, closest, did_you_mean, there_are
from trees.declarations import ANY, LIST, TYPES, UNITS, Declaration, type_fits, words
from trees.errors import Correction, Mistake, Place

from .document import REFUSED, Located, StandIn, calculates, nested, no_calculation, reference
from .lines import as_mapping, block, replaced_block, retyped

_NUMBER = r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
_QUANTITY = re.compile(rf"{_NUMBER} ?([A-Za-z\xb0]\S*)")
_PYTHON: Mapping[str, tuple[type, ...]] = {
    "integer": (int,),
    "boolean": (bool,),
    "text": (str,),
    ANY: (float, bool, str),
}

# Words of other programs, languages and libraries, with the words of task files for them.
_SWITCHES = {"yes": "true", "on": "true", "no": "false", "off": "false", "1": "true", "0": "false"}
_CHOICES = {
    **dict.fromkeys(("equals", "equal", "is"), "=="),
    **dict.fromkeys(("greater", "more"), ">"),
    "less": "<",
}
_SIGNS = str.maketrans({",": ".", "\u2212": "-", "\u2013": "-"})
_FOREIGN_UNITS = {  # factor and unit of task files
    **dict.fromkeys(("in", "inch", "inches"), (25.4, "mm")),
    **dict.fromkeys(("turn", "turns"), (360.0, "deg")),
    "m": (1.0, "min"),
}
_UNIT_NAMES = {"grad": "deg", "\xb0": "deg", "milli": "m", "centi": "c"}

# Names of units with which a key may end, by type.
_IN_KEYS = {
    "duration": {"ms", "msec", "milliseconds", "sec", "secs", "seconds", "minutes", "hours"},
    "angle": {"deg", "degs", "degrees", "rad", "radians"},
    "length": {"mm", "cm", "millimeters", "centimeters"},
}

# Vectors of directions, by the axes of ROS: x forward, y to the left, z up.
_DIRECTIONS = {
    **dict.fromkeys(("up", "z"), "[0, 0, 1]"),
    **dict.fromkeys(("down", "-z"), "[0, 0, -1]"),
    **dict.fromkeys(("forward", "front", "x"), "[1, 0, 0]"),
    **dict.fromkeys(("backward", "back", "-x"), "[-1, 0, 0]"),
    **dict.fromkeys(("left", "y"), "[0, 1, 0]"),
    **dict.fromkeys(("right", "-y"), "[0, -1, 0]"),
}

_EXAMPLES = {"integer": "3", "angle": "20 deg", "length": "5 cm", "duration": "2 s"}
_HOME = "home"  # the robot file may define it for `armtree home`

_LONG, _LONGEST = 100.0, 1e6  # shortest time without a unit that may be in milliseconds [s]

Wrong = Callable[..., None]  # callback for a mistake: place, message, and maybe the corrected line


def measured(value: Located) -> str:
    """Return the type of a quantity; empty for a number without a unit, and for other values."""
    if value.use:
        return value.declared if value.declared in UNITS else ""
    plain = value.value
    if isinstance(plain, StandIn):
        return plain.type if plain.type in UNITS else ""
    found = _QUANTITY.fullmatch(plain) if isinstance(plain, str) else None
    return next((kind for kind, units in UNITS.items() if found and found[2] in units), "")


def in_unit_of_key(key: str, value: Located) -> Located:
    """Return a number without a unit in the unit that its key names, such as `delay_msec`."""
    word = re.split("[_-]", key)[-1]
    kind = next((kind for kind, names in _IN_KEYS.items() if word in names), "")
    if not is_bare(value.value) or not kind:
        return value
    return replace(value, value=f"{value.as_yaml()} {_unit(word, UNITS[kind])}")


def renamed(key: str, name: str, value: Located) -> tuple[Located, Correction | None]:
    """Return a value with the unit that its key names, and the correction of the key to `name`."""
    made, label = in_unit_of_key(key, value) if name else value, value.label
    old, new = f"{key}: {value.as_yaml()}", f"{name}: {made.as_yaml()}"
    return made, (made is not value and label.replaced(old, new)) or label.replaced(key, name)


def in_smaller_units(value: object, unit: str) -> Iterator[tuple[str, float]]:
    """Yield a number without a unit as a text in each smaller unit, with the unit's factor.

    An angle up to a full turn is most likely in rad. There are no texts for it.
    """
    units = next((units for units in UNITS.values() if next(iter(units)) == unit), {})
    if not is_bare(value) or (unit == "rad" and abs(value) <= math.tau):
        return
    for name, factor in sorted(units.items(), key=lambda each: each[1]):
        if factor < 1:
            yield f"{value:g} {name}", factor


def in_unit_of_default(bound: Located, default: Located | None, key: str) -> str:
    """Return a bound without a unit in the unit of the default; "" if the bound needs no unit.

    The bound needs a unit if the default is within the bound only in that unit, or if the bound is
    an angle of more than a full turn.
    """
    found = _QUANTITY.fullmatch(str(default.value)) if default else None
    if not found or not is_bare(bound.value) or not (kind := measured(default or bound)):
        return ""
    sign, number = (1 if key == "min" else -1), float(found[1])
    beyond = sign * number * UNITS[kind][found[2]] < sign * bound.value <= sign * number
    turns = kind == "angle" and abs(bound.value) > math.tau
    return f"{bound.value:g} {found[2]}" if beyond or turns else ""


def in_unit_of(value: Located, point: Iterable[float]) -> tuple[str, tuple[float, ...]]:
    """Return a point [m] as a list in the unit of a written point, and its rounded value [m]."""
    items = value.value if isinstance(value.value, list) else []
    found = (_QUANTITY.fullmatch(str(item.value)) for item in items)
    unit = next((each[2] for each in found if each and each[2] in UNITS["length"]), "m")
    factor = UNITS["length"][unit]
    digits = 4 + round(math.log10(factor))  # 0.1 mm
    numbers = [round(x / factor, digits) + 0.0 for x in point]
    text = ", ".join(f"{x:g} {unit}" for x in numbers)
    return f"[{text}]", tuple(x * factor for x in numbers)


def is_bare(value: object) -> TypeGuard[float]:
    """Return True if a value is a number without a unit."""
    return type(value) in (int, float)


def near_limit(value: Located, limit: float, unit: str) -> Iterator[tuple[str, float]]:
    """Yield a limit, rounded in the unit of a value: as a text, and in the first unit of its type.

    The text that is nearest to the limit comes first. An angle without a unit is in deg. `unit` is
    the first unit of the type; "" for a number.
    """
    found = _QUANTITY.fullmatch(str(value.value))
    unit = found[2] if found else "deg" if unit == "rad" else ""
    factor = next((units[unit] for units in UNITS.values() if unit in units), 1.0)
    digits = 1 if unit == "deg" else 3
    nearest = round(limit / factor, digits)
    for number in (nearest, nearest - math.copysign(10.0**-digits, limit)):
        text = f"{number:.6g} {unit}".strip()
        yield text, float(f"{number:.6g}") * factor


def in_other_unit(words: str, value: Located, unit: str, near: str) -> str:
    """Return a message that names the assumed unit of a number, and the likely intended value."""
    numbers = [each.value for each in (value.value if isinstance(value.value, list) else [value])]
    if not any(f"{number} {unit}" in words for number in numbers):
        words += f"; {numbers[0]} without a unit is {numbers[0]} {unit}"
    return words + did_you_mean(near)


def in_radians(words: str, value: Located, unit: str, limit: float, near: str) -> str:
    """Return a message with an angle and its limit in rad, and the angle to write instead.

    A message about a length, or about an angle with a unit, does not change.
    """
    if unit != "rad" or not is_bare(value.value) or " rad" in words:
        return words
    is_so = f"{value.value} without a unit is {value.value} rad, and the limit is {limit:.7g} rad"
    return f"{words}; {is_so}: write {near}"


def doubt(value: Located, wanted: Declaration, what: str) -> Mistake | None:
    """Return a note for a likely mistake: a long time without a unit."""
    number = value.value
    if wanted.type != "duration" or value.use or not isinstance(number, int | float):
        return None
    if not _LONG <= number <= _LONGEST:
        return None
    near = f"{number:g} ms"
    long = f"{number / 60:.3g} min" if number < 3600 else f"{number / 3600:.3g} h"
    why = f"{number:g} without a unit is {number:g} s, or {long}{did_you_mean(near)}"
    return Mistake(value.place, f"{what}: {why}", value.instead(near))


def fit(
    value: Located, wanted: Declaration, poses: Mapping[str, Mapping[str, float]], wrong: Wrong
) -> Any:
    """Convert a literal value to its declared type and check it.

    Args:
        value: The value in the file.
        wanted: Declaration of the type and limits.
        poses: Joint positions [rad] by joint name, by name of the pose.
        wrong: Receives mistakes.

    Returns:
        A float in the type's first unit, an int, a bool, a str, a dict of floats, or a list of
        these; None if the value is wrong. An unknown value is a StandIn. In a dict or list, a wrong
        value is REFUSED.
    """
    if value.use and fit(value.use, wanted, poses, wrong) is None:
        return None  # the parameter has no valid value
    if isinstance(value.value, StandIn):
        return _known_type(value, value.value, wanted.type, wrong)
    if isinstance(value.value, str) and value.value in poses and wanted.refuses_poses:
        other = "a distance" if wanted.relative else words(wanted.type)
        why = f"{value.value} is a pose, not {other}; to move to it, write subtree: "
        wrong(value.place, f"{why}move_joints, with: {{joints: {value.value}}}")
        return None
    if wanted.type.startswith(LIST):
        return _items(value, wanted, poses, wrong)
    if wanted.type == "positions":
        return _positions(value, poses, wrong)
    fitted = _single(value, wanted, wrong)
    if isinstance(fitted, StandIn):
        return fitted
    if fitted is not None and (reason := _violation(fitted, wanted)):
        smaller = list(in_smaller_units(value.value, wanted.unit))
        near = [text for text, factor in smaller if not _violation(fitted * factor, wanted)]
        if wanted.type == "number" and wanted.most == 1 and 5 <= fitted <= 100:  # a percentage
            near = [f"{fitted / 100:g}"]
        meant = did_you_mean(near[0]) if near else ""
        said = str(value.plain())
        chosen = closest(said, wanted.choices)
        word = re.sub(r"^success_?on_?|[_ ](than|to)$", "", said.lower())
        common = _CHOICES.get(word, word)
        chosen = common if common in wanted.choices else chosen
        right = Located(value.place, chosen, value.label).as_yaml() if chosen else "".join(near[:1])
        meant = did_you_mean(right) if chosen == common else meant
        right = right or _within_bounds(fitted, value, wanted)
        shown = f"{value} {wanted.unit if is_bare(value.value) else ''}".rstrip()
        wrong(value.place, f"{shown} {reason}{meant}", value.instead(right))
        return None
    return fitted


def _single(value: Located, wanted: Declaration, wrong: Wrong) -> Any:
    """Return a number, a quantity, a text or a boolean; None if the value is wrong."""
    if wanted.type not in ("number", *UNITS):
        return _plain(value, wanted, wrong)

    def explained(place: Place, why: str, right: Correction | None = None) -> None:
        more = f": {wanted.description}" if wanted.description and not right else ""
        wrong(place, why + more, right)

    return _number(value, wanted.type, explained)


def _within_bounds(fitted: Any, value: Located, wanted: Declaration) -> str:
    """Return a number without its minus, or the limit that it exceeds; "" if both are wrong."""
    limits = [each for each in (wanted.least, wanted.most) if each is not None]
    if not limits:
        return ""
    likely = [*near_limit(value, min(limits, key=lambda each: abs(fitted - each)), wanted.unit)]
    if str(value.value).startswith("-"):
        likely.insert(0, (str(value.value)[1:], -fitted))
    return next((text for text, number in likely if not _violation(number, wanted)), "")


def _items(
    value: Located, wanted: Declaration, poses: Mapping[str, Mapping[str, float]], wrong: Wrong
) -> list[Any] | None:
    numbers = wanted.type.removeprefix(LIST) in ("number", "integer", *UNITS)
    near = _as_items(value) if numbers else ""
    if not isinstance(value.value, list):
        example = f"[{value.plain()}, 0, 0]" if measured(value) else "[0, 0, 0]"
        if measured(value) and wanted.least and wanted.least > 0.0:  # such as the size of a box
            near = near or f"[{', '.join([str(value.plain())] * wanted.count)}]"
        if wanted.type == f"{LIST}number":
            near, example = near or _DIRECTIONS.get(str(value.value), ""), "[0, 0, 1]"
        one = Declaration(wanted.type.removeprefix(LIST))
        if not numbers and fit(value, one, poses, lambda *_: None) is not None:
            texts = re.split(r" *[,/|] *", str(value.value)) if one.type == "text" else []
            near = f"[{', '.join(texts) or value.as_yaml()}]"
        form = f"; write {near or (example if numbers else '[a, b]')}"
        wrong(value.place, f"{value} is not {words(wanted.type)}{form}", value.instead(near))
        return None
    if wanted.count and len(value.value) != wanted.count and value.value != wanted.default:
        why = f"{value} has {plural(len(value.value), 'item')}, not {wanted.count}"
        points = re.sub(r"(\d),(?=\d)", r"\1.", value.place.brackets)
        if near:
            why = f"commas are missing in {value.as_yaml()}"
        elif numbers and points.count(",") == wanted.count - 1:
            why, near = f"{why}; a point begins the decimals, not a comma", points
        elif numbers and wanted.count == 3:
            why, near = f"{why} (x, y, z)", _filled(value, wanted)
        wrong(value.place, why + did_you_mean(near), value.instead(near))
        return None
    each = replace(wanted, type=wanted.type.removeprefix(LIST))
    fitted = [fit(item, each, poses, wrong) for item in value.value]
    return [REFUSED if item is None else item for item in fitted]


def _filled(value: Located, wanted: Declaration) -> str:
    """Return a list cut to its count, or a size with its last number repeated; else ""."""
    given = [item.as_yaml() for item in value.value] if isinstance(value.value, list) else []
    missing = wanted.count - len(given)
    if missing < 0:
        return f"[{', '.join(given[: wanted.count])}]"
    size = given and missing > 0 and wanted.least and wanted.least > 0.0
    return f"[{', '.join(given + given[-1:] * missing)}]" if size else ""


def _as_items(value: Located) -> str:
    """Return three numbers without commas, or a mapping of x, y and z, as a list; else ""."""
    inner = value.value
    axes = [value, *nested(value).values()]  # such as {position: {x: 0, y: 0, z: 0}}
    if found := next((each for each in axes if [*nested(each)] == ["x", "y", "z"]), None):
        return Located(value.place, [*nested(found).values()], value.label).as_yaml()
    text = inner[0].value if isinstance(inner, list) and len(inner) == 1 else inner
    text = re.sub(r"(?<=\d) ?[x\xd7] ?(?=\d)", " ", text) if isinstance(text, str) else ""
    items = re.findall(rf"{_NUMBER}(?: ?([a-z]+))?(?=[\s,]|$)", text)
    if len(items) != 3:
        return ""
    if items[2][1] and not items[0][1] + items[1][1]:  # such as `30x30x20 mm`
        items = [(number, items[2][1]) for number, _ in items]
    return f"[{', '.join(f'{number} {unit}'.rstrip() for number, unit in items)}]"


def _plain(value: Located, wanted: Declaration, wrong: Wrong) -> Any:
    plain, kind = value.value, wanted.type
    if kind == ANY and type(plain) is int:
        return float(plain)
    python = _PYTHON.get(kind)
    # In Python, a bool is an int.
    if python and isinstance(plain, python) and (kind != "integer" or type(plain) is int):
        return plain
    hint = "" if python else "; name a key that a skill writes, such as $key"
    near = _SWITCHES.get(str(plain).lower(), "") if kind == "boolean" else ""
    if isinstance(plain, str) and kind in ("boolean", "integer"):  # a text in quotes
        near = near or (plain if re.fullmatch(r"true|false|[0-9]+", plain) else "")
        hint = " in quotes" if near == plain else hint
    if wanted.optional and kind == "integer":
        hint = hint or "; for no limit, leave it out"
    if kind == "text" and isinstance(plain, int | float):
        near = f'"{value.as_yaml()}"'
        if wanted.choices:
            wrong(value.place, f"{value} is not one of {', '.join(wanted.choices)}")
            return None
    _not(value, kind, near, wrong, hint)
    return None


def _not(value: Located, kind: str, near: str, wrong: Wrong, hint: str = "") -> None:
    """Report a value of a wrong type, with its likely meaning."""
    near = reference(str(value.value)) or near
    if calculates(text := str(value.value)):
        hint = f"; {no_calculation(text)}"
    if kind in ("integer", "number"):
        count = re.sub(r" ?(times|x)$|^range\(|\)$", "", str(value.value).lower())
        near = near or (count if count.isdecimal() else "")
    hint = (hint if hint == " in quotes" else "") + did_you_mean(near) or hint
    if kind in _EXAMPLES and not hint and re.fullmatch(r"[A-Za-z_]*", str(value.value)):
        hint = f", such as {_EXAMPLES[kind]}"
    items = value.value if isinstance(value.value, list) else [*nested(value).values()]
    if len(items) == 1 and (measured(items[0]) == kind or type(items[0].value) in (int, float)):
        near = items[0].as_yaml()
        hint = did_you_mean(near)
    wrong(value.place, f"{value} is not {words(kind)}{hint}", value.instead(near))


def _known_type(value: Located, stand_in: StandIn, kind: str, wrong: Wrong) -> StandIn | None:
    if type_fits(stand_in.type, kind):
        return stand_in
    why, right = f"{stand_in} is {words(stand_in.type)}, not {words(kind)}", None
    if stand_in.type in TYPES:
        right = retyped(value.place, stand_in.name, stand_in.type, kind)
        why += f"; declare it with the type {kind}" if right else ""
    wrong(value.place, why, right)
    return None


def _number(value: Located, kind: str, wrong: Wrong, finite: bool = True) -> float | StandIn | None:
    plain = value.value
    if value.use and _number(value.use, kind, wrong) is None:
        return None
    if isinstance(plain, StandIn):
        return _known_type(value, plain, kind, wrong)
    if type(plain) in (int, float):
        number = float(plain)  # type: ignore[arg-type]
    elif isinstance(plain, str) and kind in UNITS and (found := _QUANTITY.fullmatch(plain)):
        if found[2] not in UNITS[kind]:
            there, right = ", ".join(sorted(UNITS[kind])), _converted(found[1], found[2], kind)
            why = f"{value}: no unit {found[2]}; there are {there}{did_you_mean(right)}"
            wrong(value.place, why, value.instead(right))
            return None
        number = float(found[1]) * UNITS[kind][found[2]]
    else:
        near = _total(str(plain), kind) or _calculated(str(plain), kind)
        near = near or str(plain).translate(_SIGNS)
        near = re.sub(rf"^{_NUMBER} ?\.\.+ ?{_NUMBER}", r"\1", near)  # a range has no value
        near = re.sub(rf"^([a-z]+) ?{_NUMBER}$", r"\2 \1", near)  # a unit before its number
        if (found := _QUANTITY.fullmatch(near)) and found[2] not in UNITS.get(kind, ()):
            near = _converted(found[1], found[2], kind) if kind in UNITS else near
        if kind == "number" and (percent := re.fullmatch(rf"{_NUMBER} ?%", near)):
            near = f"{float(percent[1]) / 100:g}"
        amount = re.fullmatch(rf"{_NUMBER}( ?({'|'.join(UNITS.get(kind, ()))}))?", near)
        _not(value, kind, near if amount else "", wrong)  # equal texts are a number in quotes
        return None
    if finite and not math.isfinite(number):
        wrong(value.place, f"{value} is not finite")
        return None
    return number


def _calculated(text: str, kind: str) -> str:
    """Return the value of a quotient, of pi with a factor or divisor, or of radians(45); or ""."""
    pi = rf"([-+]?)(?:{_NUMBER} ?\*? ?)?(?:\w+\.)?(?:pi|π)(?: ?/ ?{_NUMBER})?"
    if found := re.fullmatch(pi, text.lower()):
        factor, divisor = (float(each or 1) for each in found.groups()[1:])
        turn = math.pi if kind != "angle" else 180.0
        unit = " deg" if kind == "angle" else ""
        return f"{found[1].strip('+')}{turn * factor / divisor:.6g}{unit}" if divisor else ""
    if (found := re.fullmatch(rf"{_NUMBER} ?/ ?{_NUMBER}( ?\w+)?", text)) and float(found[2]):
        return f"{float(found[1]) / float(found[2]):.6g}{found[3] or ''}"
    found = re.fullmatch(rf"(?:\w+\.)?(?:(radians|deg2rad)|\w+)\({_NUMBER}\)", text)
    return f"{found[2]}{' deg' if found[1] else ''}" if found and kind == "angle" else ""


def _total(text: str, kind: str) -> str:
    """Return the total of several quantities, such as `1 min 30 s`; "" for other texts."""
    units, unit = UNITS.get(kind, {}), next(iter(UNITS.get(kind, {})), "")
    if kind == "duration" and (clock := re.fullmatch(r"(?:(\d+):)?(\d+):(\d\d)", text)):
        hours, minutes, seconds = (int(part or 0) for part in clock.groups())
        return f"{3600 * hours + 60 * minutes + seconds} s"
    found = re.findall(rf"{_NUMBER} ?([a-z]+)(?:[, +]*$|[, +]+(?:and +)?)", text)
    whole = re.fullmatch(rf"(?:{_NUMBER} ?[a-z]+[, +]*(?:and +)?)+", text)
    if not whole or len(found) < 2 or any(each not in units for _, each in found):
        return ""
    return f"{sum(float(number) * units[each] for number, each in found):g} {unit}"


def _converted(number: str, word: str, kind: str) -> str:
    """Return a number with an unknown unit in a unit of a type; "" if the unit is unclear."""
    factor, unit = _FOREIGN_UNITS.get(word.lower(), (1.0, _unit(word, UNITS[kind])))
    if unit not in UNITS[kind]:
        return ""
    return f"{number if factor == 1.0 else f'{float(number) * factor:.6g}'} {unit}"


def _unit(word: str, units: Iterable[str]) -> str:
    """Return the unit that a word most likely means, such as s for seconds; else an empty text."""
    short = word.lower()
    for name, unit in _UNIT_NAMES.items():
        short = short.replace(name, unit)
    likely = sorted((unit for unit in units if short.startswith(unit)), key=len)
    return (likely or [closest(word, units)])[-1]


def _positions(
    value: Located, poses: Mapping[str, Mapping[str, float]], wrong: Wrong
) -> dict[str, float | StandIn] | None:
    if isinstance(value.value, str):
        return _pose(value, value.value, poses, wrong)
    items = value.value if isinstance(value.value, list) else []
    if items and all(str(item.value) in poses for item in items):
        names = [str(item.value) for item in items]
        right = value.instead(names[0]) if len(names) == 1 else None
        wrong(value.place, _one_pose(names), right)
        return None
    if items and all(isinstance(item.value, dict) for item in items):
        wrong(value.place, "joint values are a mapping, not a list", as_mapping(value))
        return None
    if not isinstance(value.value, dict):
        near = _by_joint(items, poses)
        how = near or f"{{{_some_joint(poses)}: …}}"
        why = f"{value} is not {words('positions')}; write {how}"
        wrong(value.place, why, value.instead(near))
        return None
    if not value.value:
        wrong(value.place, f"{value} names no joint")
        return None
    lists = [item.value for item in value.value.values() if isinstance(item.value, list)]
    if len(lists) == len(value.value) == 2 and len(lists[0]) == len(lists[1]):  # in ROS
        pairs = {str(name.value): each for name, each in zip(*lists, strict=True)}
        near = replace(value, value=pairs).as_yaml()
        why = f"joint values are a mapping, not two lists; write {near}"
        rows = [f"{joint}: {each.as_yaml()}" for joint, each in pairs.items()]
        wrong(value.place, why, value.instead(near) or replaced_block(value.place, rows))
        return None
    if _no_angles(value, value.value, poses, wrong):
        return None
    # Only the compiler knows which joints slide.
    kinds = {
        j: "length" if measured(item) == "length" else "angle" for j, item in value.value.items()
    }
    fitted = {j: _number(item, kinds[j], wrong, finite=False) for j, item in value.value.items()}
    return {joint: REFUSED if number is None else number for joint, number in fitted.items()}


def _one_pose(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"write {names[0]}, without brackets"
    return f"a node moves to one pose; write one node for each of {' and '.join(names)}"


def _by_joint(items: Sequence[Located], poses: Mapping[str, Mapping[str, float]]) -> str:
    """Return angles with the names of the joints of a pose; "" if no pose has enough joints."""
    enough = (pose for pose in poses.values() if len(pose) >= len(items) > 1)
    names = min(enough, key=len, default=())
    pairs = zip(names, (item.as_yaml() for item in items), strict=False)
    joints = ", ".join(map("{0[0]}: {0[1]}".format, pairs))
    return f"{{{joints}}}" if joints else ""


def _pose(
    value: Located, name: str, poses: Mapping[str, Mapping[str, float]], wrong: Wrong
) -> dict[str, float | StandIn] | None:
    if name in poses:
        return dict(poses[name]) or None  # an empty pose is wrong and already reported
    near = reference(name) or closest(name, poses)
    there = f"no pose {name}; "
    there += f"write {near} for a parameter" if reference(name) else there_are(name, poses)
    if pairs := as_pairs(name):
        near = f"{{{', '.join(f'{joint}: {position}' for joint, position in pairs)}}}"
        there, lines = f"joint values are a mapping; write {near}", block(value.place)
        if lines and f"{value.label.location.rpartition('.')[2]}:" not in lines[0]:
            rows = [f"{joint}: {position}" for joint, position in pairs]
            wrong(value.place, there, replaced_block(value.place, rows))
            return None
    elif _number(value, "angle", lambda *_: None) is not None:
        near = f"{{{_some_joint(poses)}: {name}}}"
        there = f"{name} is an angle without a joint; write {near}"
    if name == _HOME:
        there += "; `armtree pose save home` saves the pose of `armtree home`"
    wrong(value.place, there, value.instead(near))
    return None


def as_pairs(text: str) -> list[tuple[str, str]]:
    """Return the names and values of a text in the form of `armtree move`, such as `joint_1=0`."""
    pair = r"([A-Za-z]\w*)(?: ?[=:] ?| +(?=[-+]?\d))([^\s,=:][^,=:]*?)"
    found = re.findall(rf"{pair}(?=[, ] *[A-Za-z]\w* ?[=:]|$)", text)
    return found if found and text.startswith(found[0][0]) else []


def _some_joint(poses: Mapping[str, Mapping[str, float]]) -> str:
    """Return the name of a joint for examples."""
    return next((joint for pose in poses.values() for joint in pose), "joint_1")


def _no_angles(
    value: Located,
    joints: Mapping[str, Located],
    poses: Mapping[str, Mapping[str, float]],
    wrong: Wrong,
) -> bool:
    """Report changes or poses that are written in place of angles. Return True if any."""
    if changes := _changes(joints):
        why = "a += is not for task files: to change joints, write subtree: move_relative, with: "
        wrong(value.place, f"{why}{{by: {{{changes}}}}}")
        return True
    several = [str(item.value) for item in joints.values() if item.value in [*poses]]
    if len(several) > 1:
        wrong(value.place, _one_pose(several))
        return True
    for joint, item in joints.items():
        pose = joint if item.value is None else item.value
        if isinstance(pose, str) and pose in poses:
            what = "a joint" if pose == joint else "an angle"
            why = f"{pose} is a pose, not {what}: write {pose} alone"
            wrong(value.place, why, value.instead(pose))
            return True
    return False


def _changes(joints: Mapping[str, Located]) -> str:
    """Return changes of joints in the form of `armtree move`; "" if there are none."""
    changed = {
        joint.rstrip("+ "): str(item.value).removeprefix("+=").strip()
        for joint, item in joints.items()
        if joint.endswith("+") or str(item.value).startswith("+=")
    }
    return ", ".join(f"{joint}: {by}" for joint, by in changed.items())


def _violation(fitted: Any, wanted: Declaration) -> str:
    """Return how a value violates its declaration, such as "is less than 0 s"; or ""."""
    scale, unit = DISPLAY_UNITS.get(wanted.unit, (1.0, wanted.unit))
    if wanted.least is not None and fitted < wanted.least:
        return f"is less than {scale * wanted.least:g} {unit}".rstrip()
    if wanted.most is not None and fitted > wanted.most:
        return f"is more than {scale * wanted.most:g} {unit}".rstrip()
    if wanted.choices and fitted not in wanted.choices:
        return f"is not one of {choices(str(fitted), wanted.choices)}"
    return ""
