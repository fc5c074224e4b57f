"""Compares two runs: their frames and joints."""

from bisect import bisect_right
from itertools import zip_longest
from pathlib import Path

from hardware.loading.dataclass import dataclass
from logs.reading.recording import Recording


@dataclass(frozen=True, slots=True)
class Run:
    """The frames of a recorded run, including holds. The shapes have N frames and J joints.

    Attributes:
        path: File of the recording.
        joints: Names of the joints, (J,).
        times: Time of each frame, from the first frame [s], (N,).
        positions: Commanded positions [rad], (N, J).
        frames: Texts of the frames, (N,).
    """

    path: Path
    joints: tuple[str, ...]
    times: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    frames: tuple[str, ...]

    def at(self, joint: str, time: float) -> float:
        """Return a joint's commanded position at a time [rad], interpolated between frames.

        Args:
            joint: Name of the joint.
            time: Time from the first frame [s].
        """
        column, place = self.joints.index(joint), bisect_right(self.times, time)
        if place in (0, len(self.times)):
            return self.positions[max(0, place - 1)][column]
        before, after = self.times[place - 1], self.times[place]
        share = (time - before) / (after - before)
        a, b = self.positions[place - 1][column], self.positions[place][column]
        return a + share * (b - a)


@dataclass(frozen=True, slots=True)
class Comparison:
    """The differences of two runs.

    Attributes:
        runs: Both runs.
        first: First pair of frames that differ, in words; empty if all frames are equal.
        joints: By joint: largest difference of the two positions [rad], and its time from the first
            frame [s]. Only times before the end of the shorter run count.
    """

    runs: tuple[Run, Run]
    first: str
    joints: dict[str, tuple[float, float]]


def compare(one: Path, other: Path) -> Comparison:
    """Return the differences of two recorded runs. Their first frames count as simultaneous.

    Args:
        one: Recording of the first run.
        other: Recording of the second run.

    Raises:
        RecordingError: A recording cannot be read.
    """
    a, b = run_of(one), run_of(other)
    common = [joint for joint in a.joints if joint in b.joints]
    until = min(a.times[-1], b.times[-1]) if a.times and b.times else 0.0
    times = sorted(time for time in {*a.times, *b.times} if time <= until)
    joints = {}
    for joint in common if times else ():
        apart = [(abs(a.at(joint, t) - b.at(joint, t)), -t) for t in times]
        distance, time = max(apart)
        joints[joint] = distance, -time
    return Comparison((a, b), _first(a, b), joints)


def run_of(path: Path) -> Run:
    """Return the frames of a recorded run.

    Raises:
        RecordingError: The recording cannot be read.
    """
    sent = list(Recording(path).frames())
    zero = sent[0].time if sent else 0.0
    return Run(
        path,
        sent[0].joints if sent else (),
        tuple(frame.time - zero for frame in sent),
        tuple(frame.positions for frame in sent),
        tuple(frame.text for frame in sent),
    )


def _first(a: Run, b: Run) -> str:
    for number, (one, other) in enumerate(zip_longest(a.frames, b.frames), 1):
        if one != other:
            return f"frame {number}: {one or 'none'} | {other or 'none'}"
    return ""
