"""Guesses the joints of the arm, the joints of the gripper and the link of the tool in a URDF."""

import re
from collections.abc import Iterator, Sequence

from hardware.printable import plural

from .urdf import Urdf, UrdfError, UrdfJoint

_GRIPPER = re.compile(r"gripper|finger|claw|jaw|hand|thumb|knuckle|pinch|suction", re.IGNORECASE)
_FINGER = re.compile(r"finger|claw|jaw|thumb|knuckle|pinch", re.IGNORECASE)
_TOOL = re.compile(r"(?<![a-z])(tcp|tool\d*|ee|eef|tip|grasp|flange|gripper_frame)(?![a-z])", re.I)
_FINGER_JOINTS = 4  # largest number of joints of a finger
_LEAST_ARM = 2  # smallest number of joints before a branch into fingers


class Tree:
    """The links of a URDF as a tree.

    Args:
        urdf: A valid URDF.

    Attributes:
        root: Name of the link without a parent.
    """

    def __init__(self, urdf: Urdf) -> None:
        self._moving = urdf.moving
        self._below: dict[str, list[UrdfJoint]] = {link: [] for link in urdf.links}
        for joint in urdf.joints:
            self._below[joint.parent].append(joint)
        self.root = next(iter(set(urdf.links) - {joint.child for joint in urdf.joints}))

    def moving_below(self, link: str) -> list[UrdfJoint]:
        """Return the moving joints beyond a link, nearest joint first."""
        return [joint for joint in self._beyond(link) if joint.name in self._moving]

    def branches(self, link: str) -> list[tuple[UrdfJoint, list[UrdfJoint]]]:
        """Return the branches at a link: their first joints, each with its moving joints.

        A moving first joint is one of them. A branch without an independent joint is left out.
        """
        found = []
        for joint in self._below[link]:
            own = [joint] if joint.name in self._moving else []
            moving = own + self.moving_below(joint.child)
            if any(each.mimic is None for each in moving):
                found.append((joint, moving))
        return found

    def fixed_to(self, link: str) -> list[str]:
        """Return a link, then all links that fixed joints connect to it."""
        links = [link]
        for each in links:  # the loop extends this list
            links += [j.child for j in self._below[each] if j.name not in self._moving]
        return links

    def _beyond(self, link: str) -> Iterator[UrdfJoint]:
        links = [link]
        for each in links:  # the loop extends this list
            links += [joint.child for joint in self._below[each]]
            yield from self._below[each]


def guess_gripper(urdf: Urdf) -> tuple[str, ...]:
    """Return the names of the gripper's joints without mimic joints; empty without a gripper.

    The arm is the chain from the root. It ends at the branch into fingers. Without a branch, it
    ends before the last joints with names such as `gripper` or `finger`. It also ends before the
    last joint if the link of this joint has such a name, or if another joint on the same parent
    mimics this joint.

    Raises:
        UrdfError: No joint moves, or the URDF branches into several arms.
    """
    tree, arm = Tree(urdf), list[UrdfJoint]()
    link = tree.root
    while branches := tree.branches(link):
        if len(branches) > 1:
            rest = [branch for branch in branches if not _all_of_gripper(branch[1])]
            if len(rest) != 1:
                _check_fingers(link, arm, rest)
                break
            branches = rest
        joint, moving = branches[0]
        arm += [joint] if joint is moving[0] else []
        link = joint.child
    own = [joint for joint in arm if joint.mimic is None]
    if not own and not tree.branches(tree.root):
        raise UrdfError("no joint moves; give one the type revolute, continuous or prismatic")
    leaders = {(j.mimic.leader, j.parent) for j in urdf.moving.values() if j.mimic}
    if own and (_FINGER.search(own[-1].child) or (own[-1].name, own[-1].parent) in leaders):
        own.pop()
    while own and _GRIPPER.search(own[-1].name):
        own.pop()
    independent = [joint.name for joint in urdf.moving.values() if joint.mimic is None]
    in_arm = {joint.name for joint in own}
    return tuple(name for name in independent if in_arm and name not in in_arm)


def _all_of_gripper(joints: Sequence[UrdfJoint]) -> bool:
    return all(_GRIPPER.search(joint.name) or _FINGER.search(joint.child) for joint in joints)


def _check_fingers(
    link: str, arm: list[UrdfJoint], rest: list[tuple[UrdfJoint, list[UrdfJoint]]]
) -> None:
    """Check that the branches at a link may be the fingers of a gripper."""
    short = all(len(moving) <= _FINGER_JOINTS for _, moving in rest)
    if (len(arm) < _LEAST_ARM and (rest or not arm)) or not short:
        ways = ", ".join(f"{joint.name} ({plural(len(moving), 'joint')})" for joint, moving in rest)
        raise UrdfError(
            f"the URDF branches at {link} into {ways}; armtree moves one arm: remove other arms, "
            "make their joints fixed, or name the joints of the gripper with --gripper"
        )


def guess_tool(urdf: Urdf, gripper: Sequence[str]) -> str:
    """Return the name of the link that carries the tool.

    It is the last link of the arm, or a link fixed to it with a name such as `tcp` or `tool0`.

    Args:
        urdf: The URDF.
        gripper: Names of the joints of the gripper.
    """
    tree, link = Tree(urdf), ""
    leaders = {j.name: j.mimic.leader if j.mimic else j.name for j in urdf.moving.values()}
    for joint in tree.moving_below(tree.root):
        if leaders[joint.name] not in gripper and joint.mimic is None:
            link = joint.child  # the last joint is the farthest one
    fixed = tree.fixed_to(link)
    named = (
        each for each in reversed(fixed) if _TOOL.search(each) and "finger" not in each.lower()
    )
    return next(named, link)
