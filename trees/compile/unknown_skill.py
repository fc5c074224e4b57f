"""Suggestions for skills that do not exist."""

from collections.abc import Collection, Mapping

from hardware.spelling import closest, did_you_mean, there_are
from skills import Skill
from trees.nodes.kind import KINDS
from trees.reading.document import Located
from trees.reading.node_parser import synonyms
from trees.reading.specs import SkillNode, Value

_TO_POSE = "move_joints"  # shipped subtree that moves to a pose


def meant(
    spec: SkillNode,
    skills: Mapping[str, type[Skill]],
    subtrees: Collection[str],
    poses: Collection[str],
) -> str:
    """Return the likely skill, kind of node or subtree for an unknown name; empty if unclear."""
    value = spec.ports.get("")
    text = value.value if isinstance(value, Located) else None
    if text in poses and _TO_POSE in subtrees and _TO_POSE.startswith(f"{spec.skill}_"):
        return _TO_POSE
    if isinstance(text, str) and (name := closest(f"{text}_{spec.skill}", subtrees, 0.85)):
        return name  # such as `gripper: open`
    if len([name for name in subtrees if name.startswith(f"{spec.skill}_")]) > 1:
        return ""
    for name, kind in skills.items():
        if spec.skill.lower() in kind.synonyms:
            return name
    return closest(spec.skill, (*nodes(skills), *subtrees), 0.71)


def nodes(skills: Collection[str]) -> tuple[str, ...]:
    """Return the keys that may begin a node: skills, kinds of nodes, `subtree` and `task`."""
    return (*skills, *KINDS, "subtree", "task")


def why_unknown(skill: str, skills: Collection[str], subtrees: Collection[str]) -> str:
    """Return the message for an unknown skill, with the names that exist."""
    begun = [name for name in subtrees if name.startswith(f"{skill}_")]
    if begun and skill:
        return f"no skill {skill}; there are the subtrees {', '.join(begun)}"
    if skill.lower() in ("run", "goto", "call", "execute"):
        return f"no skill {skill}; a task runs another one with task: 1, its number"
    if near := synonyms().get(skill):
        return f"no skill {skill}{did_you_mean(near)}"
    own = "; `armtree skills` lists them, and --skills DIR adds your own"
    return f"no skill {skill}; {there_are(skill, nodes(skills))}{own}"


def is_nothing(value: Value) -> bool:
    """Return True if nothing is written after a colon."""
    return isinstance(value, Located) and value.value is None
