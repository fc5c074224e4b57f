"""The start pose of an activation: the pose in the robot file, or a confirmed pose."""

from collections.abc import Callable
from pathlib import Path

import logs
from executive.errors import PoseUnconfirmed
from hardware import VIRTUAL, Arm, Robot
from hardware.loading.dataclass import dataclass

_SEARCHED = 50  # number of newest recordings to read


@dataclass(frozen=True, slots=True)
class LastCommand:
    """Last commanded pose of the arm.

    Attributes:
        positions: One value per actuated joint [rad].
        source: Source of the command: a recording, or this program.
    """

    positions: tuple[float, ...]
    source: str


class StartPose:
    """Finds the pose of the arm when its port opens.

    Args:
        robot: Description of the robot.
        port: Serial port.
        recordings: Folder of recordings, to find the last commanded pose.
        confirmed: Pose that a person confirms for the first activation: `boot`, `last` for the last
            commanded pose, or None.
    """

    def __init__(self, robot: Robot, port: str, recordings: Path, confirmed: str | None) -> None:
        self._robot, self._port, self._recordings = robot, port, recordings
        self._confirmed = confirmed
        self._last: LastCommand | None = None  # last pose that this program commanded

    def find(self, confirmed: str | None = None) -> tuple[float, ...]:
        """Return the start pose of an activation, one value per actuated joint [rad].

        Args:
            confirmed: Pose that a person confirms now.

        Raises:
            PoseUnconfirmed: Opening the port does not reset the board, and no pose is confirmed; or
                the confirmed pose is unknown or impossible.
        """
        robot, confirmed = self._robot, confirmed or self._confirmed
        reported = robot.firmware.reports_pose
        if robot.serial.resets or reported or self._port == VIRTUAL:
            if confirmed == "last":
                does = "reports the pose of the arm"
                if not reported:
                    does = f"is reset when the port opens, and the arm {robot.open_effect}"
                raise PoseUnconfirmed(
                    f"The board on port {self._port} {does}; "
                    'the pose "last" is for robots whose file says reset_on_open = false',
                    "leave out --pose last",
                )
            return robot.boot_pose
        if confirmed == "boot":
            return robot.boot_pose
        last = self._last or last_command(robot, self._recordings)
        if confirmed is None and last:
            raise PoseUnconfirmed(_offer(robot, last))
        if confirmed is None:
            raise PoseUnconfirmed(_offer(robot, last), "give --pose boot")
        if last is None:
            raise PoseUnconfirmed(
                f"No recording in {self._recordings} holds a commanded pose. Clear the space "
                "around the arm and switch the board off and on, so that the arm goes to its "
                f'{robot.firmware.words.start_pose}; then confirm the pose "boot"',
                "give --pose boot",
            )
        return last.positions

    def activate(
        self, arm: Arm, meanwhile: Callable[[], None], confirmed: str | None = None
    ) -> None:
        """Activate the arm in its start pose.

        Args:
            arm: The arm.
            meanwhile: Callback while the board boots; see `Arm.activate`.
            confirmed: Pose that a person confirms now.

        Raises:
            PoseUnconfirmed: Opening the port does not reset the board, and no valid pose is
                confirmed.
            HardwareError: The activation failed.
        """
        arm.activate(self.find(confirmed), meanwhile)
        self.note(arm.commanded)

    def note(self, positions: tuple[float, ...]) -> None:
        """Store a commanded pose [rad]. An earlier confirmation becomes void."""
        self._confirmed, self._last = None, LastCommand(positions, "by this program")


def last_command(robot: Robot, recordings: Path) -> LastCommand | None:
    """Return the last commanded pose of this robot in its newest recordings, or None."""
    names = tuple(joint.name for joint in robot.actuated)
    files = sorted(recordings.glob("*.mcap"), key=lambda path: path.name, reverse=True)
    for path in files[:_SEARCHED]:
        try:
            last = _last_pose(robot, names, logs.Recording(path))
        except logs.LogError:
            continue  # a file of another program
        if last:
            return LastCommand(last, str(path))
    return None


def _last_pose(
    robot: Robot, names: tuple[str, ...], recording: "logs.Recording"
) -> tuple[float, ...] | None:
    """Return the positions at the end of the last motion, or at the last frame before a stop.

    After a whole motion, these are its planned positions. They may differ slightly from those of
    its last frame, but encode to the same frame.
    """
    last: tuple[float, ...] | None = None
    end: tuple[float, ...] = ()
    left = -1  # unsent frames of the motion
    for record in recording.records(logs.Schedule, logs.Sent):
        match record:
            case logs.Schedule() if tuple(record.start) == names and record.samples:
                end, left = record.samples[-1], len(record.times)
            case logs.Sent(hold=True):
                left = -1
            case logs.Sent() if record.joints == names and _possible(robot, record.positions):
                last, left = record.positions, left - 1
        if left == 0 and _possible(robot, end):
            last = end
    return last


def _possible(robot: Robot, positions: tuple[float, ...]) -> bool:
    """Return True if all positions are within the limits. Other programs may write any values."""
    pairs = zip(robot.actuated, positions, strict=True)
    return all(joint.lower <= q <= joint.upper for joint, q in pairs)


def _offer(robot: Robot, last: LastCommand | None) -> str:
    reason = "Opening the port does not reset this board, so armtree does not know the pose."
    boot = f'the pose "boot" if the arm is in its {robot.firmware.words.start_pose}'
    if last is None:
        return f"{reason} Confirm {boot}; no recording holds a commanded pose"
    pose = robot.words(robot.by_joint(last.positions))
    return (
        f"{reason} The last commanded pose is {pose} ({last.source}). "
        f'Confirm the pose "last" if the arm is still in that pose, or {boot}'
    )
