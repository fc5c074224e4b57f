"""TOPP-RA on curves of lines and parabolas, with limits that also hold between the grid points.

Hung Pham and Quang-Cuong Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", IEEE Transactions on Robotics 34 (2018). With x = (ds/dt)^2 and u = d2s/dt2,
the acceleration of a joint is q' u + q'' x. The grid contains every break of the curve, and u is
constant between two grid points. There q' and x are linear in s and q'' is constant, so the
acceleration is linear in s: an interval keeps the limit if both its ends keep it, both with the q''
of that interval. (toppra's own constraints use the q'' of the next interval at the upper end, which
breaks the limit if q'' jumps, and its spline parametrizer can break it anywhere.) The speed
q' sqrt(x) can be slightly higher between two grid points than at both, and the solver rounds; so
finally the whole motion is slowed until it keeps all limits.

toppra imports scipy and matplotlib, for splines and plots that are not used here. Measured on
2 cores, 15 interleaved process starts: 0.21 s of processor time (0.20 to 0.39) and 38 MB without
the two, 0.85 s (0.82 to 1.06) and 113 MB with them. A worker that replaces a killed one has a goal
waiting. No import of a part of toppra avoids them: its packages import all their modules, and even
`toppra.constraint` imports `scipy.interpolate`. So empty modules take their place during this
import, if nothing has loaded them yet, and are removed afterwards.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

from skills.motion.arrays import Array
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.time_law import TimeLaw

_UNUSED = ("scipy.interpolate", "scipy.sparse", "matplotlib", "matplotlib.pyplot")


class _EmptyModule(ModuleType):
    """A module with an empty class for every name, because toppra inherits from some names."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


@contextmanager
def _without(names: tuple[str, ...]) -> Iterator[None]:
    """Put empty modules in place of modules that are not loaded, inside the `with` block."""
    absent = {name: _EmptyModule(name) for name in names if name not in sys.modules}
    sys.modules.update(absent)
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


with _without(_UNUSED):
    from toppra.constraint import LinearConstraint
    from toppra.solverwrapper.cy_seidel_solverwrapper import seidelWrapper


_INTERVALS = 40  # approximate number of grid intervals per section
_MIN_INTERVALS = 6  # least number of grid intervals per piece
_TIE_BREAK = 1e-9  # preference for a large u among equal x
_ROUNDING = 1e-8  # distance of x from its bound, so that rounding does not make the next step fail
_MAX_SPEED = 1e3  # the solver needs a finite bound on ds/dt [1/s]


def time_section(
    curve: Curve, breaks: Array, velocity: Array, acceleration: Array
) -> TimeLaw | None:
    """Return the fastest time law between two stops of a curve, or None if the solver fails.

    Args:
        curve: The path.
        breaks: Its breaks from one stop to the next, both included (M + 1,).
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].
    """
    grid = _grid(curve, breaks, velocity, acceleration)
    limits = _Limits(curve, velocity, acceleration)
    solver = seidelWrapper([limits], _Path(curve, grid), grid, solve_lp1d=True)
    speeds = _speeds(solver, np.diff(grid).tolist())
    if not np.all(speeds[1:] + speeds[:-1] > 0.0):  # also if one is NaN
        return None
    law = _time_law(grid, speeds)
    fast = _speed_ratio(curve, law, velocity)
    hard = law.acceleration_ratios(curve, acceleration).max()
    return law.slowed(max(1.0, fast, float(np.sqrt(hard))))


def _speeds(solver: seidelWrapper, steps: list[float]) -> Array:
    """Return ds/dt at the grid points, from rest to rest (K + 1,); NaN if the solver fails.

    TOPP-RA's two passes. Backward: the largest x from which a stop at the end can be reached.
    Forward: the largest x that can be reached below these bounds. The smallest x is always 0,
    because standing still keeps every limit, so it need not be computed.
    """
    highest, fastest = [0.0] * (len(steps) + 1), np.array([_TIE_BREAK, -1.0])
    solver.setup_solver()
    for i in reversed(range(len(steps))):
        _, highest[i] = solver.solve_stagewise_optim(
            i, None, fastest, np.nan, np.nan, 0.0, highest[i + 1]
        )
    x = [0.0] * len(highest)
    for i, step in enumerate(steps):
        hardest = np.array([-2.0 * step, -1.0])
        u, _ = solver.solve_stagewise_optim(i, None, hardest, x[i], x[i], 0.0, highest[i + 1])
        reached = x[i] + 2.0 * step * u
        x[i + 1] = min(max(reached - _ROUNDING, 0.9999 * reached, 0.0), highest[i + 1])
    solver.close_solver()
    return np.sqrt(x)


def _grid(curve: Curve, breaks: Array, velocity: Array, acceleration: Array) -> Array:
    """Return the grid: all breaks, even points between, and the ends of the first and last ramp.

    The latter make the time law exact on the lines at both ends.
    """
    even = _even_grid(breaks)
    lower, upper, second = curve.intervals(breaks)
    with np.errstate(divide="ignore", over="ignore"):
        speeds = [np.min(velocity / abs(slope)) for slope in (lower[0], upper[-1])]
        pushes = [np.min(acceleration / abs(slope)) for slope in (lower[0], upper[-1])]
    first, last = 0.5 * np.square(speeds) / pushes
    extra = [breaks[0] + first] if first < breaks[1] - breaks[0] and not second[0].any() else []
    if last < breaks[-1] - breaks[-2] and not second[-1].any():
        extra.append(breaks[-1] - last)
    apart = [s for s in extra if abs(even - s).min() > 1e-6 * (breaks[-1] - breaks[0])]
    return np.sort(np.append(even, apart))


def _even_grid(breaks: Array) -> Array:
    lengths = np.diff(breaks)
    shares = np.rint(_INTERVALS * lengths / lengths.sum())
    counts = np.maximum(_MIN_INTERVALS, shares).astype(int)
    ends = np.concatenate(([0], np.cumsum(counts)))
    return np.interp(np.arange(ends[-1] + 1), ends, breaks)


def _time_law(grid: Array, speeds: Array) -> TimeLaw:
    steps = np.diff(grid)
    times = np.concatenate(([0.0], np.cumsum(2.0 * steps / (speeds[1:] + speeds[:-1]))))
    accelerations = np.append(np.diff(speeds * speeds) / (2.0 * steps), 0.0)
    return TimeLaw(times, grid, speeds, accelerations)


def _speed_ratio(curve: Curve, law: TimeLaw, velocity: Array) -> float:
    """Return the largest joint speed, as a share of its limit.

    Within an interval its square is p(s)^2 x(s), with p and x linear in s. Its maximum is at an
    end, or where 2 p' x + p x' = 0.
    """
    p0, _, p1 = curve.intervals(law.positions)
    squares, steps = np.square(law.speeds)[:, None], np.diff(law.positions)[:, None]
    x0, x1 = squares[:-1], np.diff(squares, axis=0) / steps
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turn = -(2.0 * p1 * x0 + p0 * x1) / (3.0 * p1 * x1)
        turn = np.where(np.isfinite(turn), turn, 0.0)
    speeds = [
        abs(p0 + u * p1) * np.sqrt(np.maximum(0.0, x0 + u * x1)) / velocity
        for u in (0.0 * steps, np.clip(turn, 0.0, steps), steps)
    ]
    return float(np.max(speeds))


class _Path:
    """The attributes of a path that toppra reads; `_Limits` knows the rest."""

    def __init__(self, curve: Curve, grid: Array) -> None:
        self.dof = curve.constant.shape[1]
        self.path_interval = np.array([grid[0], grid[-1]])


class _Limits(LinearConstraint):  # type: ignore[misc]
    """Velocity limits at the grid points, acceleration limits at both ends of every interval."""

    def __init__(self, curve: Curve, velocity: Array, acceleration: Array) -> None:
        super().__init__()
        self._curve, self._velocity, self._acceleration = curve, velocity, acceleration
        self.dof = len(velocity)
        self.identical = True

    def compute_constraint_params(self, _: _Path, grid: Array) -> tuple[Array | None, ...]:
        """Return toppra's coefficients: a u + b x + c = v, F v <= g, and bounds on u and x."""
        lower, upper, second = self._curve.intervals(grid)
        # Coefficient of u at the upper end, because x there is x + 2 step u.
        ahead = upper + 2.0 * np.diff(grid)[:, None] * second
        a, b = np.hstack((lower, ahead)), np.hstack((second, second))
        # The last grid point begins no interval.
        a, b = np.vstack((a, a[-1:])), np.vstack((b, b[-1:]))
        both = np.concatenate((self._acceleration, self._acceleration))
        signs = np.vstack((np.eye(len(both)), -np.eye(len(both))))
        bounds = np.column_stack((np.zeros(len(grid)), self._max_squares(lower, upper)))
        return a, b, np.zeros_like(a), signs, np.concatenate((both, both)), None, bounds

    def _max_squares(self, lower: Array, upper: Array) -> Array:
        """Return the largest x at each grid point, from the intervals on both sides (K + 1,)."""
        steepest = np.vstack((abs(lower), np.zeros_like(lower[:1])))
        steepest[1:] = np.maximum(steepest[1:], abs(upper))
        with np.errstate(divide="ignore", over="ignore"):  # a joint at rest limits nothing
            speeds = np.min(self._velocity / steepest, axis=1)
        squares: Array = np.minimum(speeds, _MAX_SPEED) ** 2
        return squares
