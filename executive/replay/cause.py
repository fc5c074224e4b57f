"""Where a difference may come from: what contradicts itself in a recording, what is new here."""

import json
from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from typing import Any

from executive.recording.archive import robot_files_changed
from executive.recording.versions import versions
from hardware import Robot
from logs import Goal, Plan, Record, Recording
from trees.compile.port_types import known_skills
from trees.export.resolved import RESOLVED
from trees.nodes import KINDS

# Entries of `versions` that decide about plans.
PLANNING = ("planner", "numpy", "ompl", "pin", "coal", "toppra", "python", "machine", "system")


def source(
    recording: Recording, robot: Robot, records: Sequence[Record], entries: Collection[str]
) -> str:
    """Where a difference comes from, as far as the recording can tell."""
    if wrong := contradiction(recording, robot, records):
        return wrong
    if part := recording.changed:
        return f"the recording: {part} was changed after the run"
    if new := changes(recording, entries):
        return f"version: {new}"
    return "the recording: all versions are the same, so that what it says was changed"


def changes(recording: Recording, entries: Collection[str]) -> str:
    """Which versions are others than when it was recorded."""
    then, now = recording.notes.get("versions", {}), versions()
    new = ((name, then.get(name, "unknown"), now[name]) for name in entries)
    return ", ".join(f"{name} {b} instead of {a}" for name, a, b in new if a != b)


def contradiction(recording: Recording, robot: Robot, records: Sequence[Record]) -> str:
    """The first thing in a recording that contradicts another of it, or nothing."""
    if robot_files_changed(recording):
        return "description: the robot's files are others than those it was recorded with"
    goals = [record for record in records if isinstance(record, Goal)]
    targets = _targets(recording)
    for plan in (record for record in records if isinstance(record, Plan)):
        wrong = _limits(plan, robot) or _seed(plan, goals) or _task(plan, targets)
        if wrong:
            return wrong
    return ""


def _limits(plan: Plan, robot: Robot) -> str:
    joints = robot.actuated_in(plan.group) if plan.group in robot.groups else ()
    kept = zip(joints, plan.velocity_limits, plan.acceleration_limits, strict=False)
    for joint, velocity, acceleration in kept:
        if (velocity, acceleration) != (joint.velocity, joint.acceleration):
            return (
                f"limits: the plan kept {joint.name} to {velocity:g} rad/s and {acceleration:g} "
                f"rad/s2, the robot has {joint.velocity:g} and {joint.acceleration:g}"
            )
    return ""


def _seed(plan: Plan, goals: Sequence[Goal]) -> str:
    if goals and plan.seed not in {goal.seed for goal in goals}:
        return f"seed: the goal has {goals[0].seed}, the {plan.group} was planned with {plan.seed}"
    return ""


def _task(plan: Plan, targets: dict[str, set[float]]) -> str:
    for joint, value in zip(plan.joints, plan.goal, strict=False):  # it may be refused for that
        if joint in targets and value not in targets[joint]:
            spelled = ", ".join(f"{target:g}" for target in sorted(targets[joint]))
            return f"task: it sends {joint} to {spelled}, the plan to {value:g}"
    return ""


def _targets(recording: Recording) -> dict[str, set[float]]:
    """Every value that the task spells out for a joint; none where it computes any goal."""
    leaves, kinds = list(_leaves(_tree(recording))), known_skills()
    planners = {name for name, kind in kinds.items() if kind.plans_goal}
    copiers = {name for name, kind in kinds.items() if kind.copies_targets}
    goals = {str(ports.get("goal")) for skill, ports in leaves if skill in planners}
    targets: dict[str, set[float]] = {}
    for skill, ports in leaves:
        if skill in planners or not goals & set(map(str, ports.values())):
            continue
        spelled = [value for value in ports.values() if isinstance(value, dict)]
        if skill not in copiers or len(spelled) < len(ports) - 1:  # all but the goal it writes
            return {}
        for joint, value in chain.from_iterable(group.items() for group in spelled):
            if isinstance(value, int | float):
                targets.setdefault(joint, set()).add(value)
    return targets


def _tree(recording: Recording) -> Any:
    """The task as it was resolved; of what cannot be read there is nothing to tell."""
    try:
        return json.loads(recording.files.get(RESOLVED, b"{}"))
    except ValueError:
        return {}


def _leaves(node: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """All skills of a resolved tree, each with its ports."""
    conditions = {kind.condition for kind in KINDS.values()} - {""}
    for name, below in node.items() if isinstance(node, dict) else ():
        if name in KINDS or name in conditions:
            for child in below if isinstance(below, list) else [below]:
                yield from _leaves(child)
        elif isinstance(below, dict):
            yield name, below
