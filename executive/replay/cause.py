"""Finds the source of a difference: a contradiction in a recording, or a new version."""

import json
from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from typing import Any

from executive.recording.archive import robot_files_changed
from executive.recording.versions import versions
from hardware import Robot
from logs import Goal, Plan, Recording
from logs.records.file_format import DIGESTS
from trees.compile.port_types import known_skills
from trees.export.resolved import RESOLVED
from trees.nodes import KINDS

from .recorded_run import RecordedRun

# Entries of `versions` that can affect plans.
PLANNING = ("planner", "numpy", "pin", "coal", "python", "machine", "system")


def source(recording: Recording, entries: Collection[str]) -> str:
    """Return in words the source of a difference, if the recording has no contradiction.

    Args:
        recording: The recording.
        entries: Entries of `versions` that could be the source.
    """
    # If the digests themselves are missing, no changed part is known.
    if (part := recording.changed) and part != f"note {DIGESTS}":
        return f"the recording: {part} was changed or removed after the run"
    if new := changes(recording, entries):
        return f"version: {new}"
    return "the recording: all versions are the same, so its content was changed"


def changes(recording: Recording, entries: Collection[str]) -> str:
    """Return the versions that differ from those of the recording, in words."""
    then, now = recording.notes.get("versions", {}), versions()
    new = ((name, then.get(name, "unknown"), now[name]) for name in entries)
    return ", ".join(f"{name} {b} instead of {a}" for name, a, b in new if a != b)


def contradiction(run: RecordedRun) -> str:
    """Return the first contradiction within a recording in words; empty if there is none."""
    if robot_files_changed(run.recording):
        return "description: the robot's files differ from those of the run"
    goals = [record for record in run.records if isinstance(record, Goal)]
    targets = _targets(run.recording)
    for plan in (record for record in run.records if isinstance(record, Plan)):
        wrong = _limits(plan, run.robot) or _seed(plan, goals) or _task(plan, targets)
        if wrong:
            return wrong
    return ""


def _limits(plan: Plan, robot: Robot) -> str:
    joints = robot.actuated_in(plan.group) if plan.group in robot.groups else ()
    limits = zip(joints, plan.velocity_limits, plan.acceleration_limits, strict=False)
    for joint, velocity, acceleration in limits:
        own = plan.speed * joint.velocity, plan.speed * plan.speed * joint.acceleration
        if (velocity, acceleration) != own:
            return (
                f"limits: the plan limited {joint.name} to {velocity:g} rad/s and {acceleration:g} "
                f"rad/s2, but the robot has {own[0]:g} and {own[1]:g}"
            )
    return ""


def _seed(plan: Plan, goals: Sequence[Goal]) -> str:
    if goals and plan.seed not in {goal.seed for goal in goals}:
        own = goals[0].seed
        return f"seed: the goal has {own}, but the group {plan.group} was planned with {plan.seed}"
    return ""


def _task(plan: Plan, targets: dict[str, set[float]]) -> str:
    # Not strict, because a recorded goal may have the wrong length.
    for joint, value in zip(plan.joints, plan.goal, strict=False):
        if joint in targets and value not in targets[joint]:
            spelled = ", ".join(f"{target:g}" for target in sorted(targets[joint]))
            return f"task: it moves {joint} to {spelled}, but the plan moves it to {value:g}"
    return ""


def _targets(recording: Recording) -> dict[str, set[float]]:
    """Return the targets of each joint in the task, by joint; empty if the task computes a goal."""
    leaves, kinds = _skills(recording), known_skills()
    planners = {name for name, kind in kinds.items() if kind.plans_goal}
    copiers = {name for name, kind in kinds.items() if kind.copies_targets}
    goals = {str(ports.get("goal")) for skill, ports in leaves if skill in planners}
    targets: dict[str, set[float]] = {}
    for skill, ports in leaves:
        if skill in planners or not goals & set(map(str, ports.values())):
            continue
        spelled = [value for value in ports.values() if isinstance(value, dict)]
        # A skill that copies targets has one more port: the goal that it writes.
        if skill not in copiers or len(spelled) < len(ports) - 1:
            return {}
        for joint, value in chain.from_iterable(group.items() for group in spelled):
            if isinstance(value, float):
                targets.setdefault(joint, set()).add(value)
    return targets


def _skills(recording: Recording) -> list[tuple[str, dict[str, Any]]]:
    """Return all skills of the resolved task with their ports; empty if it cannot be read.

    Any program may have written the file, so it may be nested too deep for Python's stack.
    """
    try:
        tree = json.loads(recording.files.get(RESOLVED, b"{}"), parse_int=float)
        return list(_leaves(tree))
    except (ValueError, RecursionError):
        return []


def _leaves(node: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield all skills of a resolved tree, each with its ports."""
    conditions = {kind.condition for kind in KINDS.values()} - {""}
    for name, below in node.items() if isinstance(node, dict) else ():
        if name in KINDS or name in conditions:
            for child in below if isinstance(below, list) else [below]:
                yield from _leaves(child)
        elif isinstance(below, dict):
            yield name, below
