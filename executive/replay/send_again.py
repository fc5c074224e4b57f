"""Sends the frames of a recording again, as a new run."""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from py_trees.ports import PortInformation

from hardware import Frame, HardwareError, Robot, Schedule, Setpoint, load_robot
from logs import (
    Goal as RecordedGoal,
    Recording,
    Schedule as RecordedSchedule,
    Sent as RecordedFrame,
)
from skills.errors import NotReplayable
from skills.merged_motion import MergedMotion
from skills.streamed_motion import StreamedMotion

_ROUNDING = 1e-6  # [rad]
_FIRST_NUMBER = 1000  # offset of task numbers: a replay of task 1 is task 1001

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


class Replay(StreamedMotion):
    """Send the frames of a recording at their times. The arm must be at the recorded start."""

    INPUT_PORTS = {
        "recording": PortInformation(str, description="path of the recording"),
        "speed": PortInformation(float, description="1 for the recorded times, less for slower"),
    }

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check that this arm can play the frames."""
        _setpoints(Path(inputs["recording"]), robot.path)

    def compile_motion(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        """Return the recorded frames. Nothing is planned."""
        path, speed = Path(self.get_input("recording")), self.get_input("speed")
        recorded = _setpoints(path, self.context.robot.path)
        setpoints = tuple(replace(setpoint, time=setpoint.time / speed) for setpoint in recorded)
        return Schedule(setpoints, setpoints[-1].positions, setpoints[-1].time, 0.0), None


def write_replay_task(recording: Path, speed: float, robot: Robot, folder: Path) -> int:
    """Write a task that moves to the start of a recording, then sends its frames at their times.

    Args:
        recording: Path of the recording.
        speed: Factor of the speed; 1 for the recorded times, at most 1.
        robot: Robot that runs the task.
        folder: Folder to write the task file to.

    Returns:
        The number of the task.

    Raises:
        NotReplayable: The recording contains no motion.
        LogError: The recording cannot be read.
    """
    task, start = _start_of(Recording(recording))
    targets = {
        group: {joint.name: start.get(joint.name, joint.boot) for joint in robot.actuated_in(group)}
        for group in robot.groups
    }
    number = _FIRST_NUMBER + task
    text = _TASK.format(
        number=number,
        name=recording.name,
        path=json.dumps(str(recording.absolute())),
        speed=speed,
        **{group: json.dumps(target) for group, target in targets.items()},
    )
    (folder / f"{number}_replay.yaml").write_text(text)
    return number


def _start_of(recording: Recording) -> tuple[int, dict[str, float]]:
    """Return the number of the recorded task, and the start of its first motion [rad].

    Reads all frames, to refuse an unreadable file before the run.
    """
    number, start = 0, None
    for record in recording.records(RecordedGoal, RecordedSchedule, RecordedFrame):
        if isinstance(record, RecordedGoal):
            number = record.task
        elif isinstance(record, RecordedSchedule) and record.frames and start is None:
            start = record.start
    if start is None:
        what = "no motion was recorded; give a run that moved the arm"
        raise NotReplayable(f"{recording.path}: {what}")
    return number, start


@lru_cache(maxsize=1)
def _setpoints(path: Path, robot_file: Path) -> tuple[Setpoint, ...]:
    """Return the frames of a recording without holds, encoded for this robot.

    Each frame has its scheduled time from the first frame [s]. Pauses between schedules remain.

    Raises:
        NotReplayable: This arm cannot play the frames at these times.
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
            raise NotReplayable(f"{path}: a motion does not begin at the end of the previous one")
        before, passed = start, -1 / robot.firmware.rate  # one frame per period
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


def _motions(path: Path) -> list[tuple[RecordedSchedule, list[RecordedFrame]]]:
    """Return the started schedules of a recording, each with its frames.

    Raises:
        NotReplayable: A motion follows a grip, or frames have no schedule.
    """
    motions: list[tuple[RecordedSchedule, list[RecordedFrame]]] = []
    last, gripped = b"", False
    for record in Recording(path).records(RecordedSchedule, RecordedFrame):
        if isinstance(record, RecordedSchedule):
            motions.append((record, []))
        elif isinstance(record, RecordedFrame) and record.joints:
            before, last = last, record.data
            if record.hold:
                gripped |= before not in (b"", last)  # other holds repeat the last frame
                continue
            if not motions:
                raise NotReplayable(f"{path}: frames were recorded without a schedule")
            if gripped:
                raise NotReplayable(
                    f"{path}: the gripper held an object, and its command depended on where it was "
                    "measured. Such a run can be shown and verified, but not sent again"
                )
            motions[-1][1].append(record)
    return [(schedule, frames) for schedule, frames in motions if frames]


def _same(robot: Robot, frame: RecordedFrame, path: Path) -> Frame:
    encoded = _encoded(robot, frame.positions, path)
    if encoded.data != frame.data:
        raise NotReplayable(
            f"{path}: {frame.text} does not fit this arm; give the robot file of the recording"
        )
    return encoded


def _encoded(robot: Robot, positions: tuple[float, ...], path: Path) -> Frame:
    try:
        return robot.wire_format.encode(positions)
    except HardwareError as error:
        raise NotReplayable(f"{path}: this arm cannot play its frames: {error}") from error


def _check_speed(
    robot: Robot, before: tuple[float, ...], setpoint: Setpoint, seconds: float, path: Path
) -> None:
    for joint, a, b in zip(robot.actuated, before, setpoint.positions, strict=True):
        if abs(b - a) > joint.velocity * seconds + _ROUNDING:
            raise NotReplayable(
                f"{path}: {setpoint.frame} turns {joint.name} by {abs(b - a):.4f} rad in "
                f"{seconds:.4f} s; its limit is {joint.velocity:g} rad/s"
            )
