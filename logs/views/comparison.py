"""Compares two runs: their frames and joints."""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from logs.reading.recording import Recording


@dataclass(frozen=True, slots=True)
class Run:
    """The commands of a run; times are since its first frame [s].

    Attributes:
        path: The recording.
        joints: Names of the joints, (J,).
        times: Time of each frame, (N,).
        positions: Commanded positions [rad], (N, J).
        frames: Frames as text, including holds, (N,).
    """

    path: Path
    joints: tuple[str, ...]
    times: tuple[float, ...]
    positions: tuple[tuple[float, ...], ...]
    frames: tuple[str, ...]

    def at(self, joint: str, time: float) -> float:
        """Return a joint's position at a time [rad], interpolated linearly between frames."""
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
        first: First frame that differs, in words; empty if all are equal.
        joints: Largest distance while both moved [rad], and its time [s], by joint.
    """

    runs: tuple[Run, Run]
    first: str
    joints: dict[str, tuple[float, float]]


def compare(one: Path, other: Path) -> Comparison:
    """Compare two runs, aligned at the first frame of each.

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
    """Read the commands of a run.

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
