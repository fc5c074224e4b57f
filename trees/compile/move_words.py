"""Other forms of joint positions, such as the words of `armtree move` or a list of angles."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from hardware import BadPosition, Robot
from trees.declarations import UNITS, Declaration
from trees.errors import Correction, Place
from trees.reading.document import Located, nested, scalar
from trees.reading.grammar import TaskFile
from trees.reading.lines import replaced_block
from trees.reading.literals import as_pairs, fit, measured
from trees.reading.specs import SubtreeNode, Value

from .values_by_port import as_mapping, in_braces

_WIDTH = re.compile(r"([0-9]*\.?[0-9]+) ?(mm|cm|m)")


def is_width(text: str) -> bool:
    """Return True if a text is a length with its unit."""
    return _WIDTH.fullmatch(text) is not None


def as_positions(value: Value, robot: Robot) -> Value:
    """Return joint positions in another form as a mapping. Other values are unchanged.

    Other forms are the words of `armtree move`, a list of angles, and two values: the names of the
    joints and their angles.
    """
    if isinstance(value, Located) and len(nested(value)) == 2:
        items = _paired([*nested(value).values()], robot)
        return replace(value, value=items) if items else value
    if isinstance(value, Located) and isinstance(value.value, list):
        joints = robot.actuated_in("arm") if "arm" in robot.groups else ()
        if not joints or len(joints) != len(value.value):
            return value
        names = (joint.name for joint in joints)
        return replace(value, value=dict(zip(names, value.value, strict=True)))
    if not isinstance(value, Located) or not isinstance(value.value, str):
        return value
    pairs = dict(as_pairs(value.value))
    with suppress(BadPosition):  # reported for the value
        if is_width(value.value) and "gripper" in robot.groups:
            pairs = dict([_at_width(value.value, robot) or _example(robot)])
    items = {name: replace(value, value=scalar(text)) for name, text in pairs.items()}
    return replace(value, value=items) if items else value


def _paired(pair: Sequence[Located], robot: Robot) -> dict[str, Located]:
    """Return positions by joint from two values: names of joints and their positions."""
    names, positions = (each.value if isinstance(each.value, list) else [each] for each in pair)
    joints = [joint.name for joint in robot.actuated]
    if len(names) != len(positions) or any(name.value not in joints for name in names):
        return {}
    return {str(name.value): each for name, each in zip(names, positions, strict=True)}


def joints_by_name(
    spec: SubtreeNode, source: TaskFile, what: str, robot: Robot, wrong: Callable[..., None]
) -> Mapping[str, Value]:
    """Report names of joints at one port and their positions at another port.

    Args:
        spec: Use of a subtree.
        source: The subtree.
        what: Name of the subtree in messages.
        robot: The robot.
        wrong: Receives place, message and correction of the mistake.

    Returns:
        The values by port: the positions by joint at the only port for positions. If there is
        nothing to report, the values of `spec`.
    """
    takers = [port for port, each in source.parameters.items() if each.type == "positions"]
    whole = as_mapping(spec.values)
    made = as_positions(whole, robot) if len(spec.values) == 2 else whole
    if len(takers) != 1 or made is whole or not isinstance(made, Located):
        return spec.values
    written = f"{takers[0]}: {made.as_yaml()}"
    first, *_ = spec.values.values()
    right = in_braces(spec.values, f"{{{written}}}") or replaced_block(first.label, [written])
    wrong(first.label, f"{what} takes positions by joint: write with: {{{written}}}", right)
    return {takers[0]: made}


def _at_width(width: str | float, robot: Robot) -> tuple[str, str] | None:
    """Return the gripper's joint and its angle at a width, as texts; None if unknown.

    Args:
        width: The width: a text with a unit, or a number [m].
        robot: The robot.

    Raises:
        BadPosition: The gripper cannot reach this width.
    """
    if isinstance(width, str) and (found := _WIDTH.fullmatch(width)):
        width = float(found[1]) * UNITS["length"][found[2]]
    if isinstance(width, str) or not robot.gripper:
        return None
    ((joint, angle),) = robot.at_width(width).items()
    # Rounding towards 0 does not exceed the limits of a joint.
    return joint, f"{math.trunc(10 * math.degrees(angle)) / 10:g} deg"


def wrong_units(value: Located, robot: Robot, wrong: Callable[..., None]) -> bool:
    """Report lengths of joints that turn, and angles of joints that slide. Return True if any."""
    kinds = {joint.name: "length" if joint.unit == "m" else "angle" for joint in robot.joints}
    items = {joint: item for joint, item in nested(value).items() if joint in kinds}
    strange = [j for j, item in items.items() if measured(item) not in ("", kinds[j])]
    for joint in strange:
        fit(items[joint], Declaration(kinds[joint]), {}, wrong)
    return bool(strange)


def instead_of_width(value: Located, robot: Robot) -> tuple[Place, str, Correction | None] | None:
    """Return the mistake of a width that is written where joint positions belong.

    Args:
        value: Joint positions in a file.
        robot: The robot. Some grippers accept no width.

    Returns:
        The place, the message and the correct line; None if no width is given.
    """
    joints = robot.actuated_in("gripper") if "gripper" in robot.groups else ()
    names = {"gripper", *(joint.name for joint in joints if joint.unit == "rad")}
    items = {value.label: (value, "")} if isinstance(value.value, str) else {}
    items |= {item.label: (item, name) for name, item in nested(value).items() if name in names}
    for item, name in items.values() if joints else ():
        text = str(item.value)
        if is_width(text):
            why = "a task gives the position of the joint of the gripper, not its width"
            is_so = ", such as"
            try:
                if found := _at_width(text, robot):
                    is_so = f"; {text} is"
            except BadPosition as error:
                if error.limit is None:
                    return item.place, f"{why}; {error}", None
                found, is_so = _at_width(error.limit, robot), f"; {error}; the nearest is"
            written = ": ".join(found or _example(robot))
            right = item.instead(f"{{{written}}}")
            if name:
                right = item.label.replaced(f"{name}: {text}", written)
            return item.place, f"{why}{is_so} {written}", right
    return None


def _example(robot: Robot) -> tuple[str, str]:
    """Return the joint of the gripper and its boot position, as texts, for an example."""
    joint, *_ = robot.actuated_in("gripper")
    return joint.name, f"{joint.boot:g} {joint.unit}"
