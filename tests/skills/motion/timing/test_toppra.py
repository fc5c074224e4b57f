"""Curves are timed as the library toppra times them, which solves the same linear programs."""

import numpy as np
import pytest

pytest.importorskip("toppra", reason="toppra has wheels for x86-64 only")

from toppra.constraint import LinearConstraint
from toppra.solverwrapper.cy_seidel_solverwrapper import seidelWrapper

from skills.motion.arrays import Array, norms
from skills.motion.timing.toppra import time_section
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.time_law import TimeLaw


class Limits(LinearConstraint):  # type: ignore[misc]
    """Velocity limits at the grid points, acceleration limits at both ends of every interval."""

    def __init__(self, curve: Curve, velocity: Array, acceleration: Array) -> None:
        super().__init__()
        self.curve, self.velocity, self.acceleration = curve, velocity, acceleration
        self.dof, self.identical = len(velocity), True

    def compute_constraint_params(self, _: object, grid: Array) -> tuple[Array | None, ...]:
        """Return toppra's coefficients: a u + b x + c = v, F v <= g, and bounds on u and x."""
        lower, upper, second = self.curve.intervals(grid)
        ahead = upper + 2.0 * np.diff(grid)[:, None] * second
        a, b = np.hstack((lower, ahead)), np.hstack((second, second))
        a, b = np.vstack((a, a[-1:])), np.vstack((b, b[-1:]))  # no interval begins at the end
        both = np.concatenate((self.acceleration, self.acceleration))
        signs = np.vstack((np.eye(len(both)), -np.eye(len(both))))
        with np.errstate(divide="ignore"):
            before, after = (np.min(self.velocity / abs(each), axis=1) for each in (upper, lower))
        speeds = np.minimum(np.append(after, np.inf), np.insert(before, 0, np.inf))
        bounds = np.column_stack((np.zeros(len(grid)), np.minimum(speeds, 1e3) ** 2))
        return a, b, np.zeros_like(a), signs, np.concatenate((both, both)), None, bounds


class Path:
    """The attributes of a path that toppra reads."""

    def __init__(self, dof: int, grid: Array) -> None:
        self.dof, self.path_interval = dof, np.array([grid[0], grid[-1]])


def toppra_duration(curve: Curve, grid: Array, velocity: Array, acceleration: Array) -> float:
    """Return the duration of toppra's solution, which may exceed speeds within intervals [s]."""
    solver = seidelWrapper(
        [Limits(curve, velocity, acceleration)], Path(len(velocity), grid), grid, solve_lp1d=True
    )
    fastest, none, steps = np.array([-1e-9, -1.0]), np.nan, np.diff(grid)
    highest, x = np.zeros(len(grid)), np.zeros(len(grid))
    solver.setup_solver()
    for i in reversed(range(len(steps))):
        _, highest[i] = solver.solve_stagewise_optim(
            i, None, fastest, none, none, 0.0, highest[i + 1]
        )
    for i, step in enumerate(steps):
        hardest = np.array([-2.0 * step, -1.0])
        u, _ = solver.solve_stagewise_optim(i, None, hardest, x[i], x[i], 0.0, highest[i + 1])
        # Without a share of rounding, the solver fails on some curves.
        x[i + 1] = np.clip(x[i] + 2.0 * step * u - 1e-8, 0.0, highest[i + 1])
    solver.close_solver()
    speeds = np.sqrt(x)
    return float(np.sum(2.0 * steps / (speeds[1:] + speeds[:-1])))


def largest_ratio(curve: Curve, law: TimeLaw, velocity: Array, acceleration: Array) -> float:
    """Return the largest share of a limit that the motion uses, every millisecond."""
    times = np.union1d(np.arange(0.0, law.duration, 0.001), law.times)
    s, speed, push = law.at(times)
    slope, turn = curve.first_derivatives(s), curve.second_derivatives(s)
    speeds = slope * speed[:, None]
    pushes = slope * push[:, None] + turn * np.square(speed)[:, None]
    return float(max(np.max(abs(speeds) / velocity), np.max(abs(pushes) / acceleration)))


@pytest.mark.parametrize("joints", [2, 3, 6, 7])
def test_no_motion_is_slower_than_toppras(joints: int) -> None:
    """Except by what keeps the speeds within the intervals, which toppra does not."""
    random = np.random.default_rng(joints)
    for _ in range(15):
        waypoints = random.uniform(-1.5, 1.5, (random.integers(3, 7), joints))
        velocity, acceleration = random.uniform(0.3, 2.0, (2, joints))
        lengths = norms(np.diff(waypoints, axis=0))
        radii = random.uniform(0.02, 0.5) * np.minimum(lengths[:-1], lengths[1:])
        curve = Curve.through(waypoints, radii)
        law = time_section(curve, curve.breaks, velocity, acceleration)
        assert law
        theirs = toppra_duration(curve, law.positions, velocity, acceleration)
        assert 0.9999 * theirs <= law.duration <= 1.02 * theirs
        assert 0.97 < largest_ratio(curve, law, velocity, acceleration) <= 1.0 + 1e-6
