"""An arm in a Python program or a notebook, without a server.

with armtree.Arm() as arm:
    result = arm.run("pick")
"""

import weakref
from contextlib import ExitStack
from pathlib import Path
from threading import Lock
from typing import Any, Self

from hardware import VIRTUAL
from skills import Operator

from .api.codes import OK
from .api.events import Where
from .api.move import HOME, Move
from .api.outcome import Outcome
from .errors import GoalFailed
from .session import load_own_skills, open_executive
from .setup import Setup, find_own_trees
from .task_runner import TaskRunner


class Arm:
    """An arm that runs tasks. The first task activates it; `close` shuts it down.

    Its arguments are its only settings. It reads no `armtree.toml` and no environment variable, so
    that a program always moves the same arm.

    Args:
        port: Serial port such as `/dev/ttyACM0`; default: `virtual`, a simulated board.
        robot: Robot file; default: the shipped Arduinobot.
        trees: Folder with task files of your own; default: `./trees`, if it exists. The
            example tasks are in `armtree.EXAMPLES`.
        skills: Folder with Python files of skills of your own.
        recordings: Folder for recordings.
        seed: Seed of planning, from 1.
        pose: Confirmed position of the arm, `boot` or `last`; needed if opening the port does not
            reset the board.
        operator: Answers the questions of tasks. Default: no operator.
        world: JSON or YAML file with the bodies around the arm before the first task.
        planning_timeout: Longest time of a planner, without the time to read meshes, 0.1 to 3600
            [s].

    Attributes:
        executive: Runs the tasks. It can also pause, resume and report.

    Raises:
        ValueError: An argument is invalid, or a skill is broken.
        HardwareError: The robot file is wrong or names no driver, the port cannot be opened, or the
            pose is not confirmed.
        TreeError: The folder of tasks cannot be read.
        BadWorldFile: The world file is wrong or missing.
    """

    def __init__(
        self,
        port: str = VIRTUAL,
        robot: str | Path | None = None,
        trees: str | Path | None = None,
        skills: str | Path | None = None,
        recordings: str | Path = Setup.recordings,
        seed: int = Setup.seed,
        pose: str | None = None,
        operator: Operator | None = None,
        world: str | Path | None = None,
        planning_timeout: float = Setup.planning_timeout,
    ) -> None:
        _check("port", port, isinstance(port, str) and port, f"a serial port, or {VIRTUAL}")
        _check("seed", seed, type(seed) is int and seed > 0, "a whole number from 1")
        _check("world", world, world is None or isinstance(world, str | Path), "a path or None")
        _check(
            "planning_timeout",
            planning_timeout,
            type(planning_timeout) in (int, float) and 0.1 <= planning_timeout <= 3600,
            "a number from 0.1 to 3600",
        )
        _check("pose", pose, pose in (None, "boot", "last"), "boot, last or None")
        if skills is not None:
            load_own_skills(Path(skills))
        setup = Setup(
            port=port,
            robot=None if robot is None else Path(robot),
            trees=find_own_trees() if trees is None else Path(trees),
            world=None if world is None else Path(world),
            recordings=Path(recordings),
            seed=seed,
            planning_timeout=planning_timeout,
            pose=pose,
            single_user=True,
        )
        resources = ExitStack()
        self.executive = resources.enter_context(open_executive(setup, operator=operator))
        self._runner = TaskRunner(self.executive)
        self._lock = Lock()
        self._close = weakref.finalize(self, resources.close)  # also at the interpreter's exit
        self.executive.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Cancel all goals, shut the arm down and end the planners. The arm cannot be used again.

        Raises:
            LogError: A recording could not be finished.
        """
        self._close()

    def run(self, task: int | str | Move, /, **arguments: Any) -> Outcome:
        """Run a task and wait for its end. Ctrl-C cancels it and stops the arm.

        Args:
            task: Number or name of the task, or a move.
            arguments: Values of its parameters, such as `swing="30 deg"`.

        Raises:
            UnknownTask: No task has that number or name.
            TypeError: A value has a type that no parameter accepts.
            GoalFailed: The task failed, was canceled or was rejected. `cause` has the reason.
            KeyboardInterrupt: Ctrl-C was pressed. The goal has ended, and the arm has stopped.
        """
        outcome = self.attempt(task, **arguments)
        if outcome.code != OK:
            raise GoalFailed(outcome)
        return outcome

    def attempt(self, task: int | str | Move, /, **arguments: Any) -> Outcome:
        """Run a task like `run`, but also return the outcome of a failed task."""
        with self._lock:
            return self._runner.run(task, arguments)

    def move(
        self, *to: str | float, relative: bool = False, speed: float = 1.0, **joints: str | float
    ) -> Outcome:
        """Move, and wait for the end. Ctrl-C stops the arm.

        Args:
            to: The target: names of poses, `joint_1=70deg`, `width=20mm` (gripper), or x, y, z
                of the tool [m].
            relative: True if the target is a change: of joints, of x, y, z of the tool, or of its
                orientation, such as `pitch=5deg`.
            speed: Share of the robot's speed, 0.01 to 1.
            joints: Targets of joints, such as `joint_1="70 deg"`, or a number [rad].

        Raises:
            GoalFailed: The move failed, was canceled or was rejected.
            KeyboardInterrupt: Ctrl-C was pressed. The goal has ended, and the arm has stopped.
        """
        return self.run(Move.of(to, joints, relative, speed))

    def home(self, speed: float = 1.0) -> Outcome:
        """Move to the home of the robot: the pose `home`, or the home in the robot file."""
        return self.move(HOME, speed=speed)

    def where(self) -> Where:
        """Return the position of the arm."""
        return self.executive.where()

    def stop(self) -> None:
        """Stop the arm and cancel the task that runs. Any thread may call."""
        self.executive.cancel()


def _check(name: str, value: object, valid: object, wanted: str) -> None:
    if not valid:
        raise ValueError(f"{name} = {value!r} is invalid; give {wanted}")
