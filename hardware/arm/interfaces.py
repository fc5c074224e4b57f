"""Command and state interfaces by name, and the claims on them, as in ros2_control.

Every actuated joint has the command interface `<joint>/position`. Every joint, also a mimic joint,
has a state interface of the same name for its commanded position. Measured values have state
interfaces such as `<joint>/measured/position` and `<joint>/measured/temperature`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass

from hardware.description.robot import Robot
from hardware.drivers.board_protocol import Measurement
from hardware.errors import InterfaceClaimed, InterfaceUnknown, StaleGeneration
from hardware.joints import Joint


@dataclass(frozen=True, slots=True)
class Claim:
    """The right to command some joints, until it is released or a stop ends it.

    Attributes:
        owner: Name of the owner.
        interfaces: Names of the command interfaces.
        generation: Generation of the claim. The end of a claim begins the next generation, so no
            later claim equals this one.
    """

    owner: str
    interfaces: tuple[str, ...]
    generation: int


class Claims:
    """The claims on the command interfaces. Each interface has one owner at most.

    The caller holds a lock.

    Args:
        interfaces: Names of all command interfaces.

    Attributes:
        generation: Number of ended claims and stops. A motion can only begin in the generation of
            its plan.
    """

    def __init__(self, interfaces: Sequence[str]) -> None:
        self._interfaces = tuple(interfaces)
        self._held: list[Claim] = []
        self.generation = 0

    def acquire(self, owner: str, interfaces: Iterable[str], generation: int) -> Claim:
        """Claim interfaces.

        Args:
            owner: Name of the owner.
            interfaces: Names of the command interfaces.
            generation: Generation in which the motion was planned.

        Raises:
            InterfaceUnknown: An interface does not exist.
            InterfaceClaimed: Another owner has an interface.
            StaleGeneration: The arm was stopped, or another motion ended, after the planning.
        """
        names = tuple(interfaces)
        owners = {name: claim.owner for claim in self._held for name in claim.interfaces}
        for name in names:
            if name not in self._interfaces:
                raise InterfaceUnknown(name, self._interfaces)
            if name in owners:
                raise InterfaceClaimed(name, owners[name], owner)
        if generation != self.generation:
            raise StaleGeneration("the arm was stopped or moved since this motion was planned")
        claim = Claim(owner, names, generation)
        self._held.append(claim)
        return claim

    @property
    def held(self) -> bool:
        """True while an interface is claimed."""
        return bool(self._held)

    def check(self, claim: Claim) -> None:
        """Check that a claim has not ended.

        Raises:
            StaleGeneration: The claim has ended.
        """
        if claim not in self._held:
            raise StaleGeneration("this motion was stopped; nothing more is sent for it")

    def release(self, claim: Claim) -> None:
        """End a claim. Does nothing if it has ended."""
        if claim in self._held:
            self._held.remove(claim)
            self.generation += 1

    def release_all(self) -> None:
        """End all claims."""
        self._held.clear()
        self.generation += 1


def command_interfaces(robot: Robot) -> tuple[str, ...]:
    """Return the names of the command interfaces, in the order of the fields in a frame."""
    return tuple(_position(joint) for joint in robot.actuated)


def joint_positions(robot: Robot, actuated: Sequence[float]) -> dict[str, float]:
    """Return the position of every joint by name [rad], also of mimic joints.

    Args:
        robot: The robot.
        actuated: One position per actuated joint [rad].
    """
    known = {joint.name: q for joint, q in zip(robot.actuated, actuated, strict=True)}
    for joint in robot.joints:
        if joint.mimic:
            known[joint.name] = joint.mimic.value(known[joint.mimic.leader])
    return {joint.name: known[joint.name] for joint in robot.joints}


def state_interfaces(
    robot: Robot, commanded: Sequence[float], measured: Measurement | None = None
) -> Mapping[str, float]:
    """Return the state interfaces and their values, in the units of `Measurement`.

    Args:
        robot: The robot.
        commanded: One position per actuated joint [rad].
        measured: Last measurement, or None if there is none.
    """
    known = joint_positions(robot, commanded)
    interfaces = {_position(joint): known[joint.name] for joint in robot.joints}
    for quantity, values in asdict(measured).items() if measured else ():
        # An empty list of values is not measured.
        for joint, value in zip(robot.actuated, values, strict=False):
            interfaces[f"{joint.name}/measured/{quantity}"] = value
    return interfaces


def _position(joint: Joint) -> str:
    return f"{joint.name}/position"
