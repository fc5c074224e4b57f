"""Timing: as fast as the limits allow, and never beyond them."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from skills.motion.arrays import norms
from skills.motion.timing.time_parameterization import line_duration, time_curve
from skills.motion.timing.toppra import time_section
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.time_law import TimeLaw

Array = NDArray[np.float64]

ONES = np.ones(3)


def line(goal: list[float]) -> Curve:
    return Curve.through(np.array([[0.0] * len(goal), goal]), np.empty(0))


def excess(curve: Curve, profile: TimeLaw, velocity: Array, acceleration: Array) -> float:
    """Largest excess of a speed or acceleration over its limit, every 1 ms and at every knot."""
    times = np.union1d(np.arange(0.0, profile.duration, 0.001), profile.times)
    s, speed, push = profile.at(times)
    speeds = curve.first_derivatives(s) * speed[:, None]
    pushes = (
        curve.first_derivatives(s) * push[:, None]
        + curve.second_derivatives(s) * (speed * speed)[:, None]
    )
    return float(max(np.max(abs(speeds) / velocity), np.max(abs(pushes) / acceleration))) - 1.0


@pytest.mark.parametrize(
    ("goal", "duration"),
    [([-1.4, -0.6, -0.07], 3.3466), ([-1.57, 0.0, -0.9], 3.5440), ([3.0, 1.0, 0.0], 5.0)],
)
def test_straight_durations(goal: list[float], duration: float) -> None:
    """Rest to rest: 2 sqrt(d / a), or d / v + v / a if full speed is reached."""
    profile = time_curve(line(goal), ONES, 0.5 * ONES)
    assert profile
    assert profile.duration == pytest.approx(duration, abs=1e-4)
    assert line_duration(np.array(goal), ONES, 0.5 * ONES) == pytest.approx(profile.duration)
    assert line_duration(np.zeros(3), ONES, ONES) == 0.0


@given(
    goal=st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).filter(
        lambda goal: max(map(abs, goal)) > 0.01
    ),
    velocity=st.floats(0.1, 5.0),
    acceleration=st.floats(0.1, 10.0),
)
@settings(max_examples=60, deadline=None)
def test_the_trapezoidal_profile_is_the_optimum(
    goal: list[float], velocity: float, acceleration: float
) -> None:
    curve, limits = line(goal), (velocity * ONES, acceleration * ONES)
    ours = time_curve(curve, *limits)
    theirs = time_section(curve, np.linspace(0.0, curve.length, 7), *limits)
    assert ours
    assert theirs
    assert ours.duration <= 1.00001 * theirs.duration
    assert theirs.duration <= 1.001 * ours.duration
    assert excess(curve, ours, *limits) <= 1e-9


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(3, 7),
    rounding=st.floats(0.01, 1.0),
    stop=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_curves_keep_every_limit(seed: int, count: int, rounding: float, stop: bool) -> None:
    random = np.random.default_rng(seed)
    waypoints = random.uniform(-1.5, 1.5, (count, 3))
    velocity, acceleration = random.uniform(0.3, 2.0, (2, 3))
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    radii = 0.5 * rounding * np.minimum(lengths[:-1], lengths[1:])
    if stop:
        radii[0] = 0.0
    curve = Curve.through(waypoints, radii)
    profile = time_curve(curve, velocity, acceleration)
    assert profile
    assert excess(curve, profile, velocity, acceleration) <= 0.001
    assert np.all(np.diff(profile.times) >= 0.0)
    assert profile.positions[-1] == curve.length
    assert len(curve.stops) == stop


@given(seed=st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_a_blend_may_use_a_whole_leg(seed: int) -> None:
    """The curve then begins or ends with the blend, and rounding leaves no tiny line."""
    waypoints = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, 3))
    radius = norms(np.diff(waypoints, axis=0)).min()
    curve = Curve.through(waypoints, np.array([radius]))
    assert curve.breaks[0] == 0.0
    profile = time_curve(curve, ONES, 0.5 * ONES)
    assert profile
    assert excess(curve, profile, ONES, 0.5 * ONES) <= 0.001


@given(seed=st.integers(0, 10**6), share=st.floats(0.0, 0.999))
@settings(max_examples=60, deadline=None)
def test_the_rest_of_a_blend_is_no_line(seed: int, share: float) -> None:
    """Nor is a blend that uses both legs completely: one piece, but curved."""
    way, out = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 3))
    corner = way / norms(way[None])[0]
    waypoints = np.array([0.0 * way, corner, corner + out / norms(out[None])[0]])
    curve = Curve.through(waypoints, np.ones(1)).after(2.0 * share)
    assert len(curve.constant) == 1
    assert not curve.straight
    profile = time_curve(curve, ONES, 0.5 * ONES)
    assert profile
    assert excess(curve, profile, ONES, 0.5 * ONES) <= 0.001


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 6),
    rounding=st.floats(0.01, 1.0) | st.just(0.0),
)
@settings(max_examples=60, deadline=None)
def test_a_curve_is_smooth_and_stays_near_its_corners(
    seed: int, count: int, rounding: float
) -> None:
    waypoints = np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 3))
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    radii = 0.5 * rounding * np.minimum(lengths[:-1], lengths[1:])
    curve = Curve.through(waypoints, radii)
    s = np.linspace(0.0, curve.length, 4001)
    steps = np.linalg.norm(np.diff(curve.positions(s), axis=0), axis=1)
    assert steps.max() <= s[1] * (1.0 + 1e-9)
    assert np.allclose(curve.positions(s[[0, -1]]), waypoints[[0, -1]], atol=1e-12)
    if rounding > 0.0:
        bends = abs(curve.second_derivatives(s)).max()
        assert (
            abs(np.diff(curve.first_derivatives(s), axis=0)).max()
            <= bends * s[1] * (1.0 + 1e-6) + 1e-9
        )


def sums(curve: Curve, profile: TimeLaw) -> Array:
    """The sum of all absolute accelerations, every 1 ms."""
    s, speed, push = profile.at(np.arange(0.0, profile.duration, 0.001))
    accelerations = (
        curve.first_derivatives(s) * push[:, None]
        + curve.second_derivatives(s) * (speed * speed)[:, None]
    )
    return np.asarray(abs(accelerations).sum(axis=1))


@pytest.mark.parametrize("corners", [[], [[0.5, -1.0, 0.2]]])
def test_a_limit_of_the_sum_of_accelerations_is_kept(corners: list[list[float]]) -> None:
    points = np.array([[0.0, 0.0, 0.0], *corners, [1.0, -0.6, 0.9]])
    curve = Curve.through(points, np.full(len(corners), 0.2))
    profile = time_curve(curve, ONES, 2 * ONES)
    assert profile
    assert sums(curve, profile).max() > 3.0
    slowed = profile.within_sum(curve, 3.0)
    assert 0.99 * 3.0 < sums(curve, slowed).max() <= 3.0 * (1 + 1e-9)
    assert profile.within_sum(curve, 100.0) is profile
