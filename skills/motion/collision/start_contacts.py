"""Contacts in which a motion starts. The motion must not deepen a contact by more than 1 mm.

A folded arm rests on itself or on the table. Measured positions, meshes and calibration are exact
only to some millimetres, so such an arm may seem to overlap slightly.
"""

import numpy as np

from skills.motion.arrays import Array

from .checker import CollisionChecker, Contact

_TOLERANCE = 0.001  # error of depths of meshes, which may seem to grow on the way out [m]


class StartContacts:
    """The links that are closer than the margin at the start, and how close they are.

    Args:
        checker: Checks configurations in the motion's world.
        start: All actuated joints (A,) [rad].
        margin: Distance to keep [m].

    Attributes:
        checker, start: See the arguments.
        pairs: The two links of each contact.
        lever_arms: Lever arms of each contact (P, A) [m/rad].
    """

    def __init__(self, checker: CollisionChecker, start: Array, margin: float) -> None:
        self.checker, self._margin, self.start = checker, margin, start
        self._contacts = checker.contacts(start, margin)
        self.pairs = frozenset(frozenset(each[:2]) for each in self._contacts.values())
        self.lever_arms: Array = checker.scene.lever_arms[sorted(self._contacts)]

    @property
    def deepest(self) -> Contact:
        """The contact with the smallest distance."""
        return min(self._contacts.values(), key=lambda contact: contact.distance)

    def at_start(self, contact: Contact) -> Contact:
        """Return the contact that the same two links have at the start."""
        return next(each for each in self._contacts.values() if each[:2] == contact[:2])

    def clearance(self, configuration: Array) -> float:
        """Return the sum of distance - margin of the contacts that are closer than the margin [m].

        It is 0 if all contacts keep the margin in the configuration (A,) [rad], else negative. It
        is rounded to 1 um, because coal's distances depend on earlier checks, by some 1e-8 m. Equal
        queries would else give different plans.
        """
        near = self.checker.contacts(configuration, self._margin, self._contacts)
        return round(sum(contact.distance - self._margin for contact in near.values()), 6)

    def first_deeper(self, configurations: Array) -> tuple[int, Contact] | None:
        """Return the first row in which a contact is closer than at the start, or None.

        Args:
            configurations: All actuated joints (N, A) [rad].

        Raises:
            PlanTimeout: The deadline of the checker passed.
        """
        found, moved = list[tuple[int, Contact]](), abs(configurations - self.start)
        for pair, contact in self._contacts.items():
            # At most half of a gap, so that several motions together cannot close the gap.
            gap = contact.distance
            closer_by = min(_TOLERANCE, 0.5 * gap) if gap > 0.0 else _TOLERANCE
            travels = moved @ self.checker.scene.lever_arms[pair]
            rows = np.flatnonzero(travels > closer_by)  # the others cannot be closer
            if closer := self.checker.first_closer(configurations[rows], pair, gap - closer_by):
                found.append((int(rows[closer[0]]), closer[1]))
        return min(found, default=None)
