"""Sending a recording's frames once more, as a run of its own."""

import json
import tempfile
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from py_trees.ports import PortInformation

from executive.goal import Outcome
from hardware import HardwareError, Robot, Schedule, Setpoint, load_robot
from logs import Goal as RecordedGoal
from logs import Recording
from logs import Schedule as RecordedSchedule
from logs import Sent as RecordedFrame
from skills import Execute, SkillError
from skills.merged import Merged

from .wiring import Options, execute

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


class NotReplayable(SkillError):
    """The frames of a recording cannot be sent to this arm."""

    code = "goal.not_replayable"


class Replay(Execute):
    """Send the frames of a recording at their times, once the arm stands where it began."""

    INPUT_PORTS = {
        "recording": PortInformation(str, description="path of the recording"),
        "speed": PortInformation(float, description="1 for the times as recorded, less for slower"),
    }

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Refuse frames that this arm cannot take, before it moves."""
        _frames(Path(inputs["recording"]), robot.path)

    def _compile(self, start: tuple[float, ...]) -> tuple[Schedule, Merged | None]:
        path, speed = Path(self.get_input("recording")), self.get_input("speed")
        frames = _frames(path, self.context.robot.path)
        codec = self.context.robot.wire_format
        setpoints = tuple(
            Setpoint((f.time - frames[0].time) / speed, 0.0, f.positions, codec.encode(f.positions))
            for f in frames
        )
        return Schedule(setpoints, frames[-1].positions, setpoints[-1].time, 0.0), None


def send(recording: Path, speed: float, robot: Path | None, **options: Any) -> list[Outcome]:
    """Move to where a recording begins, then send its frames at their times.

    Args:
        recording: Which.
        speed: 1 for the times as recorded, less for slower.
        robot: Robot file; None for the shipped robot.
        options: All others of `wiring.Options`.

    Raises:
        NotReplayable: It holds no motion.
        LogError: It cannot be read.
        HardwareError: The robot file is wrong.
    """
    task, start = _beginning(Recording(recording))
    number = _NUMBERS + task
    arm = load_robot(robot)
    targets = {
        group: {joint.name: start.get(joint.name, joint.boot) for joint in arm.leaders(group)}
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
        given = Options(numbers=(number,), trees=Path(folder), robot=robot, **options)
        return execute(given)


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
def _frames(path: Path, robot_file: Path) -> Sequence[RecordedFrame]:
    """The frames of a recording without the holds, each as this robot would send it."""
    codec = load_robot(robot_file).wire_format
    sent = (record for record in Recording(path).records(RecordedFrame))
    frames = [frame for frame in sent if isinstance(frame, RecordedFrame) and _moves(frame)]
    for frame in frames:
        try:
            same = codec.encode(frame.positions).data == frame.data
        except HardwareError as error:
            raise NotReplayable(f"{path}: this arm cannot take its frames: {error}") from error
        if not same:
            text = frame.data.decode("ascii", "backslashreplace")
            raise NotReplayable(f"{path}: {text} is another frame on this arm; give its robot file")
    return frames
