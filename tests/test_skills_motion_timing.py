"""Timing: as quick as the limits allow, and never beyond them."""

import numpy as np
import pytest
import toppra
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from toppra.constraint import LinearConstraint

from skills.motion.curve import Curve
from skills.motion.profile import Profile
from skills.motion.timing import timed
from skills.motion.topp_ra import fastest, squares

Array = NDArray[np.float64]

ONES = np.ones(3)


def line(goal: list[float]) -> Curve:
    return Curve.through(np.array([[0.0] * len(goal), goal]), np.empty(0))


def excess(curve: Curve, profile: Profile, velocity: Array, acceleration: Array) -> float:
    """Largest speed or acceleration over its limit on a 1 ms grid and at every knot, less 1."""
    times = np.union1d(np.arange(0.0, profile.duration, 0.001), profile.times)
    s, speed, push = profile.at(times)
    speeds = curve.slopes(s) * speed[:, None]
    pushes = curve.slopes(s) * push[:, None] + curve.bends(s) * (speed * speed)[:, None]
    return float(max(np.max(abs(speeds) / velocity), np.max(abs(pushes) / acceleration))) - 1.0


@pytest.mark.parametrize(
    ("goal", "duration"),
    [([-1.4, -0.6, -0.07], 3.3466), ([-1.57, 0.0, -0.9], 3.5440), ([3.0, 1.0, 0.0], 5.0)],
)
def test_straight_durations(goal: list[float], duration: float) -> None:
    """Rest to rest: 2 sqrt(d / a), or d / v + v / a where full speed is reached."""
    profile = timed(line(goal), ONES, 0.5 * ONES)
    assert profile
    assert profile.duration == pytest.approx(duration, abs=1e-4)


@given(
    goal=st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).filter(
        lambda goal: max(map(abs, goal)) > 0.01
    ),
    velocity=st.floats(0.1, 5.0),
    acceleration=st.floats(0.1, 10.0),
)
@settings(max_examples=60, deadline=None)
def test_straight_is_toppras_optimum(
    goal: list[float], velocity: float, acceleration: float
) -> None:
    curve, limits = line(goal), (velocity * ONES, acceleration * ONES)
    ours = timed(curve, *limits)
    theirs = fastest(curve, np.linspace(0.0, curve.length, 7), *limits)
    assert ours
    assert theirs
    assert ours.duration <= 1.00001 * theirs.duration
    assert theirs.duration <= 1.001 * ours.duration
    assert excess(curve, ours, *limits) <= 1e-9


class _Path:
    """What toppra wants to know of a path when the constraint knows the rest."""

    def __init__(self, curve: Curve, grid: Array) -> None:
        self.dof = curve.base.shape[1]
        self.path_interval = np.array([grid[0], grid[-1]])


class _Limits(LinearConstraint):  # type: ignore[misc]
    """Velocity limits at the grid points, acceleration limits at both ends of every interval."""

    def __init__(self, curve: Curve, velocity: Array, acceleration: Array) -> None:
        super().__init__()
        self._curve, self._velocity, self._acceleration = curve, velocity, acceleration
        self.dof = len(velocity)
        self.identical = True

    def compute_constraint_params(self, _: _Path, grid: Array) -> tuple[Array | None, ...]:
        """In toppra's names: a u + b x + c = v, F v <= g, and bounds on u and x."""
        lower, upper, bends = self._curve.intervals(grid)
        ahead = upper + 2.0 * np.diff(grid)[:, None] * bends
        a, b = np.hstack((lower, ahead)), np.hstack((bends, bends))
        a, b = np.vstack((a, a[-1:])), np.vstack((b, b[-1:]))
        both = np.concatenate((self._acceleration, self._acceleration))
        signs = np.vstack((np.eye(len(both)), -np.eye(len(both))))
        steepest = np.vstack((abs(lower), np.zeros_like(lower[:1])))
        steepest[1:] = np.maximum(steepest[1:], abs(upper))
        fastest = np.min(self._velocity / np.maximum(steepest, 1e-9), axis=1) ** 2
        bounds = np.column_stack((np.zeros(len(grid)), fastest))
        return a, b, np.zeros_like(a), signs, np.concatenate((both, both)), None, bounds


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 6),
    joints=st.integers(1, 7),
    rounding=st.floats(0.05, 1.0),
)
@settings(max_examples=60, deadline=None)
def test_our_topp_ra_is_that_of_its_authors(
    seed: int, count: int, joints: int, rounding: float
) -> None:
    """Their package, on the same grid with the same constraints, finds the same speeds."""
    random = np.random.default_rng(seed)
    waypoints = random.uniform(-1.5, 1.5, (count, joints))
    velocity, acceleration = random.uniform(0.3, 2.0, (2, joints))
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    curve = Curve.through(waypoints, 0.5 * rounding * np.minimum(lengths[:-1], lengths[1:]))
    grid = np.unique(np.concatenate([np.linspace(0.0, curve.length, 50), curve.breaks]))
    solver = toppra.algorithm.TOPPRA(
        [_Limits(curve, velocity, acceleration)],
        _Path(curve, grid),
        gridpoints=grid,
        solver_wrapper="seidel",
    )
    _, speeds, _ = solver.compute_parameterization(0.0, 0.0)
    assume(speeds is not None)  # theirs gives up now and then
    ours = np.sqrt(squares(curve, grid, velocity, acceleration))
    assert np.allclose(ours, speeds, rtol=1e-3, atol=1e-3 * speeds.max())
    steps = 2.0 * np.diff(grid)
    times = [(steps / (each[1:] + each[:-1])).sum() for each in (ours, speeds)]
    assert times[0] <= 1.0005 * times[1]


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(3, 7),
    rounding=st.floats(0.01, 1.0),
    stop=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_bent_keeps_every_limit(seed: int, count: int, rounding: float, stop: bool) -> None:
    random = np.random.default_rng(seed)
    waypoints = random.uniform(-1.5, 1.5, (count, 3))
    velocity, acceleration = random.uniform(0.3, 2.0, (2, 3))
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    radii = 0.5 * rounding * np.minimum(lengths[:-1], lengths[1:])
    if stop:
        radii[0] = 0.0
    curve = Curve.through(waypoints, radii)
    profile = timed(curve, velocity, acceleration)
    assert profile
    assert excess(curve, profile, velocity, acceleration) <= 0.001
    assert np.all(np.diff(profile.times) >= 0.0)
    assert profile.places[-1] == curve.length
    assert len(curve.stops) == stop


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 6),
    rounding=st.floats(0.01, 1.0) | st.just(0.0),
)
@settings(max_examples=60, deadline=None)
def test_curve_is_smooth_and_stays_near_its_corners(seed: int, count: int, rounding: float) -> None:
    waypoints = np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 3))
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    radii = 0.5 * rounding * np.minimum(lengths[:-1], lengths[1:])
    curve = Curve.through(waypoints, radii)
    s = np.linspace(0.0, curve.length, 4001)
    steps = np.linalg.norm(np.diff(curve.positions(s), axis=0), axis=1)
    assert steps.max() <= s[1] * (1.0 + 1e-9)
    assert np.allclose(curve.positions(s[[0, -1]]), waypoints[[0, -1]], atol=1e-12)
    if rounding > 0.0:
        bends = abs(curve.bends(s)).max()
        assert abs(np.diff(curve.slopes(s), axis=0)).max() <= bends * s[1] * (1.0 + 1e-6) + 1e-9
