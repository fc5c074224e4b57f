"""Skills that do not exist: what their names most likely mean."""

from collections.abc import Collection

from hardware.suggestions import closest, did_you_mean, there_are
from trees.reading.document import Located
from trees.reading.node_parser import synonyms
from trees.reading.specs import SkillNode, Value

# Words of other languages and libraries, and the skill that does the same.
_SYNONYMS = {"sleep": "Wait", "delay": "Wait", "pause": "Wait", "print": "Say", "log": "Say"}


def meant(spec: SkillNode, known: Collection[str], subtrees: Collection[str]) -> str:
    """Return the skill, kind of node or subtree that an unknown skill means; empty if unclear."""
    value = spec.ports.get("")
    text = value.value if isinstance(value, Located) else None
    if isinstance(text, str) and (name := closest(f"{text}_{spec.skill}", subtrees, 0.85)):
        return name  # such as `gripper: open`
    if len([name for name in subtrees if name.startswith(f"{spec.skill}_")]) > 1:
        return ""
    return _SYNONYMS.get(spec.skill.lower(), "") or closest(spec.skill, (*known, *subtrees), 0.71)


def why_unknown(skill: str, known: Collection[str], subtrees: Collection[str]) -> str:
    """Return what there is instead of an unknown skill."""
    begun = [name for name in subtrees if name.startswith(f"{skill}_")]
    if begun and skill:
        return f"no skill {skill}; subtrees that begin so are {', '.join(begun)}"
    if near := synonyms().get(skill):
        return f"no skill {skill}{did_you_mean(near)}"
    own = "; `armtree skills` lists them, and --skills DIR adds your own"
    return f"no skill {skill}; {there_are(skill, known)}{own}"


def is_nothing(value: Value) -> bool:
    """Return whether nothing is written after a colon."""
    return isinstance(value, Located) and value.value is None
