"""Suggestions for skills, subtrees and tasks that do not exist."""

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress

from hardware import Robot
from hardware.spelling import closest, did_you_mean, there_are
from skills import Skill
from trees.errors import Correction, FileError
from trees.nodes.kind import KINDS
from trees.reading.document import Located
from trees.reading.library import Library
from trees.reading.lines import rewritten
from trees.reading.literals import as_pairs
from trees.reading.node_words import synonyms
from trees.reading.specs import SkillNode, SubtreeNode, Value

from .move_words import as_positions, is_width
from .values_by_port import as_mapping, fits

TO_POSE, TO_POINT = "move_joints", "move_tool"  # shipped subtrees that move the arm
_OTHER_NAMES = {"movej": TO_POSE, "movel": TO_POINT}  # their names in the languages of other robots


def meant(
    spec: SkillNode,
    skills: Mapping[str, type[Skill]],
    library: Library,
    poses: Collection[str],
    robot: Robot,
) -> str:
    """Return the likely skill, kind of node or subtree for an unknown name; empty if unclear."""
    value, subtrees = spec.ports.get(""), library.subtrees()
    begun, poses = _begun(spec.skill, subtrees), {*poses}  # empty if a file of poses is unreadable
    if spec.skill in poses and not spec.ports and TO_POSE in subtrees and not begun:
        return TO_POSE
    text = value.value if isinstance(value, Located) else None
    text = text.removesuffix(".yaml") if isinstance(text, str) else text
    if TO_POSE in _begun(_first(spec.skill), subtrees) and target_pose(spec.ports, poses):
        return TO_POSE
    other = _by_other_name(spec, skills, subtrees)
    whole = as_mapping(spec.ports)
    if len(spec.ports) == 2 and as_positions(whole, robot) is not whole and TO_POSE in subtrees:
        return TO_POSE
    if isinstance(text, str) and not other:
        if name := closest(f"{text}_{spec.skill}", subtrees, 0.85):
            return name  # such as `gripper: open`
        target = text in poses or is_width(text) or (begun and as_pairs(text))
        if target and TO_POSE in subtrees:
            return TO_POSE
        if text in subtrees:
            return text
    if begun:
        return _taking(spec.skill, spec.ports, library) if begun[1:] else begun[0]
    if other:
        return other
    near = closest(spec.skill, (*nodes(skills), *subtrees), 0.71)
    return near or (_taking(_first(spec.skill), spec.ports, library) if spec.ports else "")


def _by_other_name(
    spec: SkillNode, skills: Mapping[str, type[Skill]], subtrees: Collection[str]
) -> str:
    """Return the skill or subtree for a name of another program, or for a point; else ""."""
    word = re.sub(r"_?(cmd|command|action|node|skill|step)$", "", spec.skill.lower())
    named = (name for name, kind in skills.items() if word in kind.synonyms)
    to_point = TO_POINT if [*spec.ports] == ["x", "y", "z"] else ""
    name = next(named, _OTHER_NAMES.get(word, to_point))
    return name if name in (*skills, *subtrees) else ""


def target_pose(ports: Mapping[str, Value], poses: Collection[str]) -> Located | None:
    """Return the only value at ports that is a pose, such as the target of a group; or None."""
    values = [each for each in ports.values() if isinstance(each, Located)]
    named = [each for each in values if isinstance(each.value, str) and each.value in [*poses]]
    return named[0] if len(named) == 1 and "" not in ports else None


def meant_file(
    spec: SubtreeNode, library: Library
) -> tuple[str | int, str, Correction | None] | None:
    """Return the likely file for an unknown file, the message and the correct line.

    The file is "" if no file is likely. The result is None if the file exists.
    """
    source, tasks, subtrees = spec.source, library.names(), library.subtrees()
    if not isinstance(source, str) or not source:
        return None
    file: str | int = ""
    if spec.head == "task":
        near = source if source in tasks else closest(source, tasks)
        file, why = tasks.get(near, ""), f"no task {source}; {there_are(source, tasks)}"
        if source in tasks:
            why = f"a node gives the number of a task, not its name: write task: {file}"
        elif source in subtrees:
            file, why = source, f"{source} is a subtree, not a task: write subtree: {source}"
    elif source in subtrees:
        return None
    elif source in tasks:
        file = tasks[source]
        why = f"{source} is a task, not a subtree: write task: {file}"
    else:
        file, there = _meant_subtree(source, spec.values, library)
        why = f"no subtree {source}; {there}"
    named = spec.named
    if not named:
        return file, why, None
    head = "task" if isinstance(file, int) else "subtree"
    right = named.label.replaced(f"{spec.head}: {source}", f"{head}: {file}")
    return file, why, None if file == "" else right


def _meant_subtree(source: str, values: Mapping[str, Value], library: Library) -> tuple[str, str]:
    """Return the likely subtree for an unknown name, or "", and advice for the message."""
    subtrees = library.subtrees()
    if (begun := _begun(source, subtrees))[1:]:
        near = _taking(source, values, library)
        return near, f"there are the subtrees {', '.join(begun)}{did_you_mean(near)}"
    there, stem = there_are(source, subtrees), re.split(r"[/\\]", source)[-1].removesuffix(".yaml")
    if stem in subtrees:
        return stem, f"write the name without the folder: {stem}"
    near = closest(source, subtrees)
    if near and (other := only_taker(values, library)) and other != near:
        return other, did_you_mean(other).removeprefix("; ")
    return near, there if near else f"{there}; a subtree of your own is a file {stem}.yaml"


def _begun(word: str, subtrees: Collection[str]) -> list[str]:
    """Return the subtrees with a name that begins with a word."""
    return [name for name in subtrees if word and name.startswith(f"{word.lower()}_")]


def _first(skill: str) -> str:
    """Return the first word of a name such as MoveGroup."""
    return re.split(r"(?<=[a-z])(?=[A-Z])|_", skill)[0]


def _taking(word: str, values: Mapping[str, Value], library: Library) -> str:
    """Return the subtree that takes the given values, and whose name begins with a word.

    If there is none, return the only subtree that takes the values; empty if there are several.
    """
    names = library.subtrees()
    found = [*_takers(values, _begun(word, names), library)] or [*_takers(values, names, library)]
    return TO_POSE if TO_POSE in found else found[0] if len(found) == 1 else ""


def only_taker(values: Mapping[str, Value], library: Library) -> str:
    """Return the only subtree that takes the given ports; empty if not exactly one does."""
    found = [*_takers(values, library.subtrees(), library)]
    return found[0] if len(found) == 1 else ""


def _takers(values: Mapping[str, Value], names: Collection[str], library: Library) -> Iterator[str]:
    """Yield the subtrees that take values at these ports, or a value without a port."""
    for name in names:
        with suppress(FileError):
            ports = library.draft(name)[0].parameters
            needed = [port for port, each in ports.items() if each.needed and not each.output]
            whole = values.get("", as_mapping(values))
            one = len(needed) == 1 and isinstance(whole, Located) and fits(whole, ports[needed[0]])
            if values and ({*needed} <= values.keys() <= ports.keys() or one):
                yield name


def without_ports(spec: SubtreeNode, what: str, robot: Robot) -> tuple[str, Correction | None]:
    """Return the mistake of values for a subtree without ports, and the correct lines.

    A width of the gripper needs another subtree.
    """
    given = spec.values.get("", as_mapping(spec.values))
    written = given.as_yaml() if isinstance(given, Located) else f"${given.name}"
    why, node = f"leave {written} out", {spec.head: str(spec.source)}
    for value in spec.values.values():
        if (target := as_positions(value, robot)) is not value and isinstance(target, Located):
            node = {"subtree": TO_POSE, "with": f"{{joints: {target.as_yaml()}}}"}
            why = f"to move the gripper, write subtree: {TO_POSE}, with: {node['with']}"
    node |= {"name": spec.name} if spec.name else {}
    return f"{what}; {why}", rewritten(spec.place, node)


def nodes(skills: Collection[str]) -> tuple[str, ...]:
    """Return the keys that can begin a node: skills, kinds of nodes, `subtree` and `task`."""
    return (*skills, *KINDS, "subtree", "task")


def why_unknown(skill: str, skills: Collection[str], subtrees: Collection[str]) -> str:
    """Return the message for an unknown skill, with the names that exist."""
    if begun := _begun(skill, subtrees):
        return f"no skill {skill}; there are the subtrees {', '.join(begun)}"
    if skill.lower() in ("run", "goto", "call", "execute"):
        return f"no skill {skill}; to run another task, write its number, such as task: 1"
    if near := synonyms().get(skill):
        return f"no skill {skill}{did_you_mean(near)}"
    there, the_skills = there_are(skill, nodes(skills)), "them"
    if begun := _begun(_first(skill), subtrees):
        are = "are the subtrees" if begun[1:] else "is the subtree"
        there, the_skills = f"there {are} {', '.join(begun)}", "the skills"
    own = f"`armtree skills` lists {the_skills}, and --skills DIR adds your own"
    return f"no skill {skill}; {there}" + ("" if there.endswith("?") else f"; {own}")


def is_nothing(value: Value) -> bool:
    """Return True if a value is empty: nothing is written after the colon."""
    return isinstance(value, Located) and value.value is None
