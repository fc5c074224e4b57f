"""Sending a recording's frames once more, as a run of its own."""

import json
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from py_trees.ports import PortInformation

from executive.goals.outcome import Outcome
from executive.setup import Setup
from hardware import Frame, HardwareError, Robot, Schedule, Setpoint, load_robot
from logs import Goal as RecordedGoal
from logs import Recording
from logs import Schedule as RecordedSchedule
from logs import Sent as RecordedFrame
from skills import Execute
from skills.errors import NotReplayable
from skills.merged_motion import MergedMotion

from .run import execute

_ROUNDING = 1e-6  # [rad]
_NUMBERS = 1000  # a replay of task 1 is task 1001

_TASK = """\
task: {number}
name: replay
description: Send the frames of {name} again.
tree:
  sequence:
    - subtree: reach
      with:
        arm: {arm}
        gripper: {gripper}
    - Replay: {{recording: {path}, speed: {speed}}}
"""


class Replay(Execute):
    """Send the frames of a recording at their times, once the arm stands where it began."""

    INPUT_PORTS = {
        "recording": PortInformation(str, description="path of the recording"),
        "speed": PortInformation(float, description="1 for the times as recorded, less for slower"),
    }

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Refuse frames that this arm cannot take, before it moves."""
        _setpoints(Path(inputs["recording"]), robot.path)

    def _compile(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        path, speed = Path(self.get_input("recording")), self.get_input("speed")
        recorded = _setpoints(path, self.context.robot.path)
        setpoints = tuple(replace(setpoint, time=setpoint.time / speed) for setpoint in recorded)
        return Schedule(setpoints, setpoints[-1].positions, setpoints[-1].time, 0.0), None


def send(
    recording: Path, speed: float, setup: Setup, as_json: bool, verbose: bool
) -> list[Outcome]:
    """Move to where a recording begins, then send its frames at their times.

    Args:
        recording: Which.
        speed: 1 for the times as recorded, less for slower.
        setup: What to run on, apart from the tasks.
        as_json: As of `execute`.
        verbose: As of `execute`.

    Raises:
        NotReplayable: It holds no motion.
        LogError: It cannot be read.
        HardwareError: The robot file is wrong.
    """
    task, start = _beginning(Recording(recording))
    number = _NUMBERS + task
    arm = setup.load_robot()
    targets = {
        group: {joint.name: start.get(joint.name, joint.boot) for joint in arm.actuated_in(group)}
        for group in arm.groups
    }
    with tempfile.TemporaryDirectory() as folder:
        text = _TASK.format(
            number=number,
            name=recording.name,
            path=json.dumps(str(recording.absolute())),
            speed=speed,
            **{group: json.dumps(target) for group, target in targets.items()},
        )
        (Path(folder) / f"{number}_replay.yaml").write_text(text)
        return execute(
            replace(setup, trees=Path(folder)), [number], as_json=as_json, verbose=verbose
        )


def _beginning(recording: Recording) -> tuple[int, dict[str, float]]:
    """The number of the task that was recorded, and where its first motion begins [rad]."""
    number = 0
    for record in recording.records(RecordedGoal, RecordedSchedule):
        if isinstance(record, RecordedGoal):
            number = record.task
        elif isinstance(record, RecordedSchedule) and record.frames:
            return number, record.start
    raise NotReplayable(f"{recording.path}: no motion was recorded; give a run that moved the arm")


def _moves(sent: RecordedFrame) -> bool:
    """Whether it is a frame of a motion, neither a hold nor a setting of the board."""
    return bool(sent.joints) and not sent.hold


@lru_cache(maxsize=1)
def _setpoints(path: Path, robot_file: Path) -> tuple[Setpoint, ...]:
    """The frames of a recording without the holds, each as this robot would send it.

    They are due as scheduled, and schedules follow each other as they did; times are since the
    first frame [s].

    Raises:
        NotReplayable: This arm cannot take them, or not at these times.
    """
    robot = load_robot(robot_file)
    setpoints: list[Setpoint] = []
    zero: float | None = None
    for schedule, frames in _motions(path):
        first = frames[0].scheduled
        if first is None or len(frames) > len(schedule.times):
            raise NotReplayable(f"{path}: more frames were recorded than were scheduled")
        begins = first - schedule.times[0]
        zero = first if zero is None else zero
        start = tuple(schedule.start.values())
        if setpoints and _encoded(robot, start, path) != setpoints[-1].frame:
            raise NotReplayable(f"{path}: a motion does not begin where the one before it ended")
        before, passed = start, -1 / robot.firmware.rate  # a frame is carried out in one period
        for due, frame in zip(schedule.times, frames, strict=False):
            setpoint = Setpoint(
                begins + due - zero, 0.0, frame.positions, _same(robot, frame, path)
            )
            if setpoints and not setpoint.time > setpoints[-1].time:
                raise NotReplayable(
                    f"{path}: {setpoint.frame} is not due after the frame before it"
                )
            _check_speed(robot, before, setpoint, due - passed, path)
            setpoints.append(setpoint)
            before, passed = frame.positions, due
    if not setpoints:
        raise NotReplayable(f"{path}: no frame was sent; give a run that moved the arm")
    return tuple(setpoints)


def _motions(path: Path) -> Iterator[tuple[RecordedSchedule, list[RecordedFrame]]]:
    """The schedules of a recording that were begun, each with its frames."""
    schedule: RecordedSchedule | None = None
    frames: list[RecordedFrame] = []
    for record in Recording(path).records(RecordedSchedule, RecordedFrame):
        if isinstance(record, RecordedFrame) and _moves(record):
            frames.append(record)
            if schedule is None:
                raise NotReplayable(f"{path}: frames were recorded without a schedule")
        elif isinstance(record, RecordedSchedule):
            if schedule and frames:
                yield schedule, frames
            schedule, frames = record, []
    if schedule and frames:
        yield schedule, frames


def _same(robot: Robot, frame: RecordedFrame, path: Path) -> Frame:
    encoded = _encoded(robot, frame.positions, path)
    if encoded.data != frame.data:
        raise NotReplayable(
            f"{path}: {frame.text} is another frame on this arm; give its robot file"
        )
    return encoded


def _encoded(robot: Robot, positions: tuple[float, ...], path: Path) -> Frame:
    try:
        return robot.wire_format.encode(positions)
    except HardwareError as error:
        raise NotReplayable(f"{path}: this arm cannot take its frames: {error}") from error


def _check_speed(
    robot: Robot, before: tuple[float, ...], setpoint: Setpoint, seconds: float, path: Path
) -> None:
    for joint, a, b in zip(robot.actuated, before, setpoint.positions, strict=True):
        if abs(b - a) > joint.velocity * seconds + _ROUNDING:
            raise NotReplayable(
                f"{path}: {setpoint.frame} turns {joint.name} by {abs(b - a):.4f} rad in "
                f"{seconds:.4f} s; its limit is {joint.velocity:g} rad/s"
            )
