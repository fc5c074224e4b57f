"""Sends the frames of a recording again, as a new run."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from py_trees.ports import PortInformation

from hardware import Frame, HardwareError, Robot, Schedule, Setpoint, load_robot
from hardware.loading.dataclass import dataclass
from logs import (
    Goal as RecordedGoal,
    Recording,
    Schedule as RecordedSchedule,
    Sent as RecordedFrame,
)
from skills.errors import NotReplayable
from skills.merged_motion import MergedMotion
from skills.streamed_motion import StreamedMotion, begun_at

Motion = tuple[RecordedSchedule, list[RecordedFrame]]

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
"""
_PART = "    - Replay: {{recording: {path}, part: {part}, speed: {speed}}}\n"


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the recorded frames. Each grip of an object ends a part and begins the next.

    Attributes:
        start: Commanded positions before the first frame [rad].
        setpoints: The frames. Times count from the grip that begins the part; in the first part,
            from the first frame [s].
    """

    start: tuple[float, ...]
    setpoints: tuple[Setpoint, ...]


class Replay(StreamedMotion):
    """Send frames of a recording at their times. The arm must be at the recorded start.

    A gripper that holds an object may be at another position. It stays there until a frame moves
    it.
    """

    INPUT_PORTS = {
        "recording": PortInformation(str, description="path of the recording"),
        "part": PortInformation(
            int, description="index of the part, from 0; each grip begins another part"
        ),
        "speed": PortInformation(float, description="factor of the recorded speed, at most 1"),
    }

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check that this arm can play the frames."""
        _parts(Path(inputs["recording"]), robot.path)

    def compile_motion(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        """Return the recorded frames. Nothing is planned."""
        path, robot = Path(self.get_input("recording")), self.context.robot
        part, speed = _parts(path, robot.path)[self.get_input("part")], self.get_input("speed")
        frames = tuple(replace(each, time=each.time / speed) for each in part.setpoints)
        done = frames[-1].time + 1 / robot.firmware.rate
        schedule = Schedule(frames, frames[-1].positions, done, 0.0)
        return begun_at(robot, schedule, part.start, start), None


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
        **{group: json.dumps(target) for group, target in targets.items()},
    )
    path = json.dumps(str(recording.absolute()))
    for part in range(len(_parts(recording, robot.path))):
        text += _PART.format(path=path, part=part, speed=speed)
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
def _parts(path: Path, robot_file: Path) -> tuple[Part, ...]:
    """Return the frames of a recording without holds, encoded for this robot.

    Each frame has its scheduled time. Pauses between schedules remain.

    Raises:
        NotReplayable: This arm cannot play the frames at these times.
    """
    robot, parts = load_robot(robot_file), list[Part]()
    for zero, motions in _motions(path):
        setpoints = tuple(_setpoints(path, robot, zero, motions))
        if setpoints:
            parts.append(Part(tuple(motions[0][0].start.values()), setpoints))
    if not parts:
        raise NotReplayable(f"{path}: no frame was sent; give a run that moved the arm")
    return tuple(parts)


def _setpoints(
    path: Path, robot: Robot, zero: float | None, motions: Iterable[Motion]
) -> Iterator[Setpoint]:
    """Yield the frames of motions. Their times count from `zero`, or from the first frame [s]."""
    last: Setpoint | None = None
    for schedule, frames in motions:
        first = frames[0].scheduled
        if first is None or len(frames) > len(schedule.times):
            raise NotReplayable(f"{path}: more frames were recorded than were scheduled")
        begins = first - schedule.times[0]
        zero = first if zero is None else zero
        start = tuple(schedule.start.values())
        if last and _encoded(robot, start, path) != last.frame:
            raise NotReplayable(f"{path}: a motion does not begin at the end of the previous one")
        before, passed = start, -1 / robot.firmware.rate  # one frame per period
        for due, frame in zip(schedule.times, frames, strict=False):
            setpoint = Setpoint(
                begins + due - zero, 0.0, frame.positions, _same(robot, frame, path)
            )
            if last and not setpoint.time > last.time:
                raise NotReplayable(
                    f"{path}: {setpoint.frame} is due at or before the time of the previous frame"
                )
            _check_speed(robot, before, setpoint, due - passed, path)
            yield setpoint
            last, before, passed = setpoint, frame.positions, due


def _motions(path: Path) -> list[tuple[float | None, list[Motion]]]:
    """Split the recording at each grip.

    Returns:
        For each part: the time of the grip that begins it [s], None for the first; and its
        schedules with the sent frames of each. Schedules without a sent frame are left out.

    Raises:
        NotReplayable: Frames have no schedule.
    """
    parts, last = list[tuple[float | None, list[Motion]]]([(None, [])]), b""
    for record in Recording(path).records(RecordedSchedule, RecordedFrame):
        if isinstance(record, RecordedSchedule):
            parts[-1][1].append((record, []))
        elif isinstance(record, RecordedFrame) and record.joints:
            before, last = last, record.data
            if record.hold and before not in (b"", last):  # a grip; other holds repeat the frame
                parts.append((record.time, []))
            if record.hold:
                continue
            if not parts[-1][1]:
                raise NotReplayable(f"{path}: frames were recorded without a schedule")
            parts[-1][1][-1][1].append(record)
    return [(time, [each for each in motions if each[1]]) for time, motions in parts]


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
        raise NotReplayable(f"{path}: this arm cannot play the frames: {error}") from error


def _check_speed(
    robot: Robot, before: tuple[float, ...], setpoint: Setpoint, seconds: float, path: Path
) -> None:
    for joint, a, b in zip(robot.actuated, before, setpoint.positions, strict=True):
        if abs(b - a) > joint.velocity * seconds + _ROUNDING:
            raise NotReplayable(
                f"{path}: {setpoint.frame} turns {joint.name} by {abs(b - a):.4f} rad in "
                f"{seconds:.4f} s; the limit of the joint is {joint.velocity:g} rad/s"
            )
