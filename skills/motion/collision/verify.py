"""The last check: the motion as it will be played, between its rows too."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from skills.motion.deadline import Deadline
from skills.motion.errors import BadQuery, MotionCollides, NotFinite, shown
from skills.motion.measures import FARTHEST, is_number
from skills.motion.path.space import LEAST_STEP
from skills.motion.query import Verify

from .checker import CollisionChecker

Array = NDArray[np.float64]

_CHUNK = 500  # configurations between two looks at the deadline


def check_motion(
    checker: CollisionChecker,
    lever_arms: Array,
    joints: Sequence[str],
    request: Verify,
    deadline: Deadline,
) -> None:
    """Follow the rows of a request, less than its margin of travel at a time.

    Raises:
        MotionCollides: The first contact along the motion.
        BadQuery, NotFinite: The rows make no sense.
        PlanTimeout: The time is up.
    """
    rows, times = _checked(request, joints)
    step = max(request.margin, LEAST_STEP)
    blocked = checker.first_invalid_contact(rows[:1], request.margin)
    if blocked:
        time = None if times is None else float(times[0])
        raise MotionCollides(0, time, *blocked[1], request.margin)
    for chunk in _places(rows, lever_arms, step):
        deadline.check()
        points = _between(rows, chunk)
        hit = checker.first_collision(points, request.margin)
        if hit is not None:
            nearest = checker.nearest(points[hit])
            assert nearest
            place = chunk[hit]
            time = None if times is None else float(np.interp(place, range(len(rows)), times))
            raise MotionCollides(int(place), time, *nearest, request.margin)


def _places(rows: Array, lever_arms: Array, step: float) -> Iterator[Array]:
    """Where to look, in rows and fractions of rows: 0 ... N - 1, a chunk at a time."""
    travels = (abs(np.diff(rows, axis=0)) @ lever_arms.T).max(axis=1, initial=0.0)
    counts = np.append((travels / step).astype(int) + 1, 1)
    ends = np.cumsum(counts)
    for begin in range(0, int(ends[-1]), _CHUNK):
        numbers = np.arange(begin, min(begin + _CHUNK, int(ends[-1])))
        row = np.searchsorted(ends, numbers, side="right")
        yield row + (numbers - (ends - counts)[row]) / counts[row]


def _between(rows: Array, places: Array) -> Array:
    before = places.astype(int)
    after = np.minimum(before + 1, len(rows) - 1)
    points: Array = rows[before] + (places - before)[:, None] * (rows[after] - rows[before])
    return points


def _checked(request: Verify, joints: Sequence[str]) -> tuple[Array, Array | None]:
    rows, times, margin = np.asarray(request.configurations), request.times, request.margin
    if rows.ndim != 2 or rows.shape[1] != len(joints) or not len(rows):
        wanted = f"rows of {len(joints)} ({', '.join(joints)}), at least one"
        raise BadQuery(f"The configurations have the shape {rows.shape}; give {wanted}")
    if times is not None and np.shape(times) != (len(rows),):
        raise BadQuery(f"There are {np.size(times)} times for {len(rows)} rows; give one for each")
    if not is_number(margin, 0.0, FARTHEST):
        raise BadQuery(f"The margin is {shown(margin)} m; give a number from 0 to {FARTHEST:g}")
    for row, column in np.argwhere(~np.isfinite(rows)):
        raise NotFinite(f"row {row}", joints[column], float(rows[row, column]))
    for row, column in np.argwhere(abs(rows) > FARTHEST):
        what = f"Row {row} has {joints[column]} at {rows[row, column]:g}"
        raise BadQuery(f"{what}; give at most {FARTHEST:g} rad or m either way")
    return rows, None if times is None else np.asarray(times)
