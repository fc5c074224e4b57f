"""Where the arm stands when its port opens: known after a reset, else a person's word."""

from dataclasses import dataclass, replace
from pathlib import Path

import logs
from executive.errors import PoseUnconfirmed
from hardware import VIRTUAL, Robot

POSES = ("boot", "last")

_LOOKED_AT = 50  # newest recordings


@dataclass(frozen=True, slots=True)
class Commanded:
    """Where the arm was commanded to last.

    Attributes:
        positions: One value per actuated joint [rad].
        told: By what.
    """

    positions: tuple[float, ...]
    told: str


def standing(
    robot: Robot, port: str, pose: str | None, recordings: Path, last: Commanded | None = None
) -> Robot:
    """The robot, with the pose it stands in when its port is opened as its boot pose.

    Args:
        robot: Which.
        port: Its serial port.
        pose: What a person says: `boot`, `last` for where it was commanded to last, or None.
        recordings: Folder that tells where that was.
        last: Where this program itself has commanded it to, where it did.

    Raises:
        PoseUnconfirmed: The board is not reset, and a person has to say; or there is nothing to
            confirm.
    """
    if robot.serial.resets or port == VIRTUAL:
        if pose == "last":
            raise PoseUnconfirmed(
                f"Opening the port {port} resets the board, which moves the arm to its boot pose; "
                "--pose last is for robots whose file says reset_on_open = false"
            )
        return robot
    if pose == "boot":
        return robot
    found = last or last_commanded(robot, recordings)
    if pose is None:
        raise PoseUnconfirmed(_offer(robot, found))
    if found is None:
        raise PoseUnconfirmed(
            f"No recording in {recordings} tells where the arm was commanded to; bring it to its "
            "boot pose, then give --pose boot"
        )
    stands = dict(zip((joint.name for joint in robot.actuated), found.positions, strict=True))
    joints = []
    for joint in robot.joints:
        leader = stands[joint.mimic.leader] if joint.mimic else stands[joint.name]
        joints.append(replace(joint, boot=joint.mimic.value(leader) if joint.mimic else leader))
    return replace(robot, joints=tuple(joints))


class StartPose:
    """Where the arm stands, from one activation to the next.

    Args:
        robot: As its file has it.
        port: Its serial port.
        recordings: Folder that tells where it was commanded to by others.
        pose: What a person has said for the first activation.
    """

    def __init__(self, robot: Robot, port: str, recordings: Path, pose: str | None) -> None:
        self._robot, self._port, self._recordings = robot, port, recordings
        self._pose = pose
        self._last: Commanded | None = None

    def taken(self, pose: str | None) -> Robot:
        """The robot to activate, as `standing` has it.

        Args:
            pose: What a person says now.

        Raises:
            PoseUnconfirmed: As of `standing`.
        """
        said = pose or self._pose
        return standing(self._robot, self._port, said, self._recordings, self._last)

    def commanded(self, positions: tuple[float, ...]) -> None:
        """Note where the arm is commanded to [rad]; what was said of it before holds no longer."""
        self._pose, self._last = None, Commanded(positions, "by this program")


def last_commanded(robot: Robot, recordings: Path) -> Commanded | None:
    """Where the newest recording that moved this arm has left it; None where none did."""
    names = tuple(joint.name for joint in robot.actuated)
    files = sorted(recordings.glob("*.mcap"), key=lambda path: path.name, reverse=True)
    for path in files[:_LOOKED_AT]:
        try:
            sent = list(logs.Recording(path).records(logs.Sent))
        except logs.LogError:
            continue  # no recording of ours
        for record in reversed(sent):
            if isinstance(record, logs.Sent) and record.joints == names:
                return Commanded(record.positions, str(path))
    return None


def _offer(robot: Robot, found: Commanded | None) -> str:
    asked = "The board is not reset when its port opens, so that only you can say where the arm is."
    boot = "--pose boot where it stands in its boot pose"
    if found is None:
        return f"{asked} Give {boot}; no recording tells where it was commanded to"
    where = ", ".join(
        f"{joint.name} {q:.3f}" for joint, q in zip(robot.actuated, found.positions, strict=True)
    )
    return (
        f"{asked} It was commanded to {where} rad last ({found.told}). "
        f"Give --pose last where it still stands there, or {boot}"
    )
