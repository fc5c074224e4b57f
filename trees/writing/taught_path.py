"""A hand-guided path: measured samples, simplified to waypoints."""

import math
from collections.abc import Iterator, Mapping, Sequence

from hardware import Robot

Sample = Mapping[str, float]  # position of every actuated joint [rad], [m]

# No sample is further than this from the straight lines between waypoints.
JOINT_TOLERANCE = {"rad": math.radians(1), "m": 0.002}  # tolerance of a joint
TOOL_TOLERANCE = 0.002  # tolerance of the tool [m]

_SETTLED = 25  # number of samples without motion after which the gripper counts as still


def simplify(robot: Robot, samples: Sequence[Sample], joints: Sequence[str]) -> list[Sample]:
    """Return a few samples that keep the path within the tolerances, in order.

    This is the algorithm of Douglas and Peucker. The sample furthest from the line between two
    waypoints becomes a waypoint, until no sample is too far. The first and last samples stay.

    Args:
        robot: The robot.
        samples: The path.
        joints: Names of the joints of the path.
    """
    tools = [robot.tool_position(sample) for sample in samples]
    units = {joint.name: joint.unit for joint in robot.actuated}
    scales = [JOINT_TOLERANCE[units[name]] for name in joints]
    rows = [
        [sample[name] / s for name, s in zip(joints, scales, strict=True)] for sample in samples
    ]

    def excess(begin: int, end: int, number: int) -> float:
        """Return the distance of a sample from the line of two others, divided by the tolerance."""
        first, last, row = rows[begin], rows[end], rows[number]
        line = [b - a for a, b in zip(first, last, strict=True)]
        length = math.hypot(*line) ** 2
        along = sum(d * (q - a) for d, q, a in zip(line, row, first, strict=True))
        share = min(max(along / length, 0.0), 1.0) if length else 0.0
        near = [a + share * d for a, d in zip(first, line, strict=True)]
        worst = max(abs(q - p) for q, p in zip(row, near, strict=True))
        tool = tools[number]
        if tool is None:
            return worst
        there = {name: p * s for name, p, s in zip(joints, near, scales, strict=True)}
        nearest = robot.tool_position({**samples[number], **there})
        assert nearest
        return max(worst, math.dist(tool, nearest) / TOOL_TOLERANCE)

    kept, parts = {0, len(samples) - 1}, [(0, len(samples) - 1)]
    while parts:
        begin, end = parts.pop()
        far, number = max(
            ((excess(begin, end, k), k) for k in range(begin + 1, end)), default=(0, 0)
        )
        if far > 1.0:
            kept.add(number)
            parts += [(begin, number), (number, end)]
    return [samples[number] for number in sorted(kept)]


def split(
    robot: Robot, samples: Sequence[Sample], gripper: Sequence[str]
) -> Iterator[tuple[Sequence[Sample], Sample]]:
    """Divide a path into parts, so that the gripper moves only between two parts.

    Args:
        robot: The robot.
        samples: The path.
        gripper: Names of the joints of the gripper.

    Yields:
        A part, and the position of the gripper after it.
    """
    units = {joint.name: joint.unit for joint in robot.actuated}

    def apart(one: Sample, other: Sample, times: float) -> bool:
        return any(
            abs(one[name] - other[name]) > times * JOINT_TOLERANCE[units[name]] for name in gripper
        )

    begin, held, number = 0, samples[0], 0
    while number < len(samples):
        if apart(samples[number], held, 3.0):
            end = number
            while end + 1 < len(samples) and any(
                apart(samples[end], each, 1.0) for each in samples[end : end + _SETTLED]
            ):
                end += 1
            held = samples[end]
            yield samples[begin : number + 1], {name: held[name] for name in gripper}
            begin = number
            number = max(end, number)
        number += 1
    if begin < len(samples) - 1 or not begin:
        yield samples[begin:], {name: held[name] for name in gripper}
