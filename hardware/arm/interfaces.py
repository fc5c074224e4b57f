"""Interfaces by name, as in ros2_control: what can be commanded and known, and who commands it.

Every joint with a servo has the command interface `<joint>/position`; every joint, those that
follow another included, has the state interface of the same name.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from hardware.description.robot import Robot
from hardware.errors import InterfaceClaimed, InterfaceUnknown, StaleGeneration
from hardware.joints import Joint


@dataclass(frozen=True, slots=True)
class Claim:
    """The right to command some joints, until it is given up or a stop ends it.

    Attributes:
        owner: Who has it.
        interfaces: Names of the command interfaces.
        generation: In which it was taken; its end begins the next, so no later claim equals it.
    """

    owner: str
    interfaces: tuple[str, ...]
    generation: int


class Claims:
    """Who commands which joint; one user at a time. Its caller locks.

    Args:
        interfaces: The command interfaces there are.

    Attributes:
        generation: Counts the ends of claims, and stops; a motion is decided on in one.
    """

    def __init__(self, interfaces: Sequence[str]) -> None:
        self._interfaces = tuple(interfaces)
        self._held: list[Claim] = []
        self.generation = 0

    def take(self, owner: str, interfaces: Iterable[str], generation: int) -> Claim:
        """Claim interfaces for a motion that was decided on in a generation.

        Raises:
            InterfaceUnknown: There is no such interface.
            InterfaceClaimed: Another owner has it.
            StaleGeneration: There was a stop, or another motion ended, since then.
        """
        names = tuple(interfaces)
        taken = {name: claim.owner for claim in self._held for name in claim.interfaces}
        for name in names:
            if name not in self._interfaces:
                raise InterfaceUnknown(name, self._interfaces)
            if name in taken:
                raise InterfaceClaimed(name, taken[name], owner)
        if generation != self.generation:
            raise StaleGeneration("the arm was stopped or moved since this motion was decided on")
        claim = Claim(owner, names, generation)
        self._held.append(claim)
        return claim

    def check(self, claim: Claim) -> None:
        """Refuse a claim that has ended.

        Raises:
            StaleGeneration: It has.
        """
        if claim not in self._held:
            raise StaleGeneration("this motion was stopped; nothing more is sent for it")

    def give_up(self, claim: Claim) -> None:
        """End a claim. Harmless when it has ended."""
        if claim in self._held:
            self._held.remove(claim)
            self.generation += 1

    def end(self) -> None:
        """End all claims."""
        self._held.clear()
        self.generation += 1


def command_interfaces(robot: Robot) -> tuple[str, ...]:
    """The interfaces that can be claimed, in the order of the fields in a frame."""
    return tuple(_position(joint) for joint in robot.actuated)


def state_interfaces(robot: Robot, commanded: Sequence[float]) -> Mapping[str, float]:
    """The state interfaces and their values [rad]: the command, for nothing is measured.

    Args:
        robot: Whose joints.
        commanded: One value per actuated joint [rad].
    """
    known = {joint.name: q for joint, q in zip(robot.actuated, commanded, strict=True)}
    for joint in robot.joints:
        if joint.mimic:
            known[joint.name] = joint.mimic.value(known[joint.mimic.leader])
    return {_position(joint): known[joint.name] for joint in robot.joints}


def _position(joint: Joint) -> str:
    return f"{joint.name}/position"
