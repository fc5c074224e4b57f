"""The set-up of an executive, as one value."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .api import Policy

if TYPE_CHECKING:
    from hardware import Robot


def find_own_trees() -> Path | None:
    """Return `./trees`, or None if there is no such folder."""
    return own if (own := Setup.own_trees).is_dir() else None


@dataclass(frozen=True, kw_only=True)
class Setup:
    """The set-up: a robot, its tasks, and options of runs. `armtree.toml` has the same defaults.

    Attributes:
        robot: Path of the robot file, or a loaded robot; None for the shipped Arduinobot.
        port: Serial port, or `virtual`; empty for no port; None for the port of the robot file.
        trees: Folder with task files of your own; None for the shipped tasks only.
        reload: True if each goal uses the latest valid task files; False if they are read once.
        own_trees: With `reload`, folder with task files if `trees` is None. It may be made later.
        recordings: Folder for recordings.
        recording_timeout: Longest time that a frame waits for the recording of the previous frame
            [s]. Then the motion ends.
        keep_days: Age at which a recording is deleted [days]; None for never.
        keep_mb: Largest total size of the recordings [MB]. If it is exceeded, the oldest are
            deleted. None for no limit.
        world: JSON or YAML file with the bodies around the arm before the first goal; None for no
            bodies.
        seed: Seed of planning.
        workers: Number of planner processes.
        planning_timeout: Longest time of a planner, without the time to read meshes [s].
        policy: Policy for a second goal.
        result_timeout: Time for which the result of an ended goal is kept [s]; see `GoalQueue`.
        single_user: True if only one caller sends goals. A goal then activates the arm, and its
            recording continues until `Executive.finish_recording`.
        activate: True to activate the arm at once; False if a goal or a client activates it.
        pose: Position of the arm, confirmed by a person: `boot`, `last` for the last commanded
            position, or None. Needed if opening the port does not reset the board.
    """

    robot: "Path | Robot | None" = None
    port: str | None = None
    trees: Path | None = None
    reload: bool = True
    own_trees: Path = Path("trees")
    recordings: Path = Path("recordings")
    recording_timeout: float = 5.0
    keep_days: float | None = None
    keep_mb: float | None = None
    world: Path | None = None
    seed: int = 1
    workers: int = 1
    planning_timeout: float = 5.0
    policy: Policy = Policy.REJECT
    result_timeout: float = 900.0
    single_user: bool = False
    activate: bool = False
    pose: str | None = None

    def load_robot(self) -> "Robot":
        """Return the robot.

        Raises:
            DescriptionError: The robot file or its URDF is wrong.
        """
        from hardware import Robot, load_robot  # slow to import

        return self.robot if isinstance(self.robot, Robot) else load_robot(self.robot)
