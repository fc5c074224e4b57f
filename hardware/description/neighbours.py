"""Neighbouring links, which may touch by design, and warnings about the shapes of links."""

import json
from collections.abc import Collection
from itertools import combinations

from .meshes import visual_mesh_warnings
from .robot import Robot
from .urdf import Urdf


def adjacent_links(urdf: Urdf, shaped: Collection[str]) -> set[frozenset[str]]:
    """Return the pairs of neighbouring links with shapes. Links without shapes are skipped.

    Args:
        urdf: The URDF.
        shaped: Names of the links with shapes.
    """
    below: dict[str, list[str]] = {link: [] for link in urdf.links}
    for joint in urdf.joints:
        below[joint.parent].append(joint.child)
    found = set[frozenset[str]]()
    for link in urdf.links:
        reached = list(below[link])
        for each in reached:  # the loop extends this list
            if each not in shaped:
                reached += below[each]
        ends = [each for each in reached if each in shaped]
        pairs = ((link, end) for end in ends) if link in shaped else combinations(ends, 2)
        found |= set(map(frozenset, pairs))
    return found


def advice_for_contact(robot: Robot, first: str, second: str) -> str:
    """Return advice about two links that touch. Neighbours may be allowed to touch.

    Args:
        robot: The robot.
        first: Name of the first link or body.
        second: Name of the second link or body.

    Returns:
        The advice, or an empty text if they are not neighbours.
    """
    urdf = robot.description
    shaped = [link for link, count in urdf.shape_counts().items() if count]
    if frozenset((first, second)) not in adjacent_links(urdf, shaped):
        return ""
    pair = json.dumps([first, second])
    where = f"allowed under [collision] in {robot.path.name}"
    return f"they are neighbours, so add {pair} to {where}"


def shape_warnings(robot: Robot) -> list[str]:
    """Return warnings about links without collision shapes, and about missing visual meshes.

    The missing meshes of one package share a warning.
    """
    urdf = robot.description
    counts, visible = urdf.shape_counts(), urdf.shape_counts("visual")
    bare = ", ".join(link for link, count in counts.items() if visible[link] and not count)
    found = []
    if not any(counts.values()):
        found = ["no <collision> in the URDF, so no collision is found; add one to each link"]
    elif bare:
        why = "in the URDF, so these are not checked; add one to each"
        found = [f"no <collision> for {bare} {why}"]
    return [*found, *map(str, visual_mesh_warnings(robot.urdf, urdf))]
