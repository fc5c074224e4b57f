"""TOPP-RA on a curve of lines and parabolas, with limits that hold between grid points too.

Hung Pham and Quang-Cuong Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", IEEE Transactions on Robotics 34 (2018). With x = (ds/dt)^2 and
u = d2s/dt2 a joint's acceleration is q' u + q'' x. The grid holds every break of the curve and u is
constant between two points of it; there q' and x are linear in s and q'' is constant, so the
acceleration is linear in s: keeping the limit at both ends of an interval, both with that
interval's own q'', keeps it all along. (toppra's own constraints take q'' from the next interval
at the upper end, which breaks the limit wherever q'' jumps, and its spline parametrizer breaks it
anywhere.) The speed q' sqrt(x) may rise a little above its ends between them, and the solver
rounds; what is left of that is taken out by slowing the whole motion.
"""

import numpy as np
from numpy.typing import NDArray

from skills.motion.path.curve import Curve

from .profile import Profile
from .toppra_parts import LinearConstraint, seidelWrapper

Array = NDArray[np.float64]

_POINTS = 40  # grid intervals in a section, about
_LEAST = 6  # in any piece of it
_SLIGHT = 1e-9  # preference of u where x is the same
_ROUNDING = 1e-8  # kept off what the solver calls reachable, or it may not be in the next step
_FASTEST = 1e3  # the solver wants a finite bound on ds/dt [1/s]


def fastest(curve: Curve, breaks: Array, velocity: Array, acceleration: Array) -> Profile | None:
    """The quickest time law between two stops of a curve; None where the solver fails.

    Args:
        curve: The path.
        breaks: Its breaks from one stop to the next, both included (M + 1,).
        velocity: Limits (J,) [rad/s].
        acceleration: Limits (J,) [rad/s2].
    """
    grid = _grid(curve, breaks, velocity, acceleration)
    limits = _Limits(curve, velocity, acceleration)
    solver = seidelWrapper([limits], _Path(curve, grid), grid, solve_lp1d=True)
    speeds = _speeds(solver, np.diff(grid).tolist())
    if not np.all(speeds[1:] + speeds[:-1] > 0.0):  # nor if it is not a number
        return None
    profile = _profile(grid, speeds)
    fast, hard = _speed(curve, profile, velocity), _push(curve, profile, acceleration)
    return profile.stretched(max(1.0, fast, float(np.sqrt(hard))))


def _speeds(solver: seidelWrapper, steps: list[float]) -> Array:
    """ds/dt at the grid points, from rest to rest (K + 1,); not a number where the solver fails.

    The two passes of TOPP-RA: backward, the largest x from which a stop at the end can still be
    reached; forward, the largest x that can be reached below these. The least such x is 0 always,
    as who stands keeps every limit, so it need not be solved for.
    """
    highest, fastest = [0.0] * (len(steps) + 1), np.array([_SLIGHT, -1.0])
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
    """All breaks, points between, and where full speed is reached from the ends if on a line."""
    even = _even(breaks)
    lower, upper, bends = curve.intervals(breaks)
    with np.errstate(divide="ignore", over="ignore"):
        speeds = [np.min(velocity / abs(slope)) for slope in (lower[0], upper[-1])]
        pushes = [np.min(acceleration / abs(slope)) for slope in (lower[0], upper[-1])]
    first, last = 0.5 * np.square(speeds) / pushes
    extra = [breaks[0] + first] if first < breaks[1] - breaks[0] and not bends[0].any() else []
    if last < breaks[-1] - breaks[-2] and not bends[-1].any():
        extra.append(breaks[-1] - last)
    apart = [s for s in extra if abs(even - s).min() > 1e-6 * (breaks[-1] - breaks[0])]
    return np.sort(np.append(even, apart))


def _even(breaks: Array) -> Array:
    lengths = np.diff(breaks)
    counts = np.maximum(_LEAST, np.rint(_POINTS * lengths / lengths.sum())).astype(int)
    ends = np.concatenate(([0], np.cumsum(counts)))
    return np.interp(np.arange(ends[-1] + 1), ends, breaks)


def _profile(grid: Array, speeds: Array) -> Profile:
    steps = np.diff(grid)
    times = 2.0 * steps / (speeds[1:] + speeds[:-1])
    pushes = np.diff(speeds * speeds) / (2.0 * steps)
    return Profile(np.concatenate(([0.0], np.cumsum(times))), grid, speeds, np.append(pushes, 0.0))


def _push(curve: Curve, profile: Profile, acceleration: Array) -> float:
    """Largest joint acceleration over its limit; it is linear in between the grid points."""
    lower, upper, bends = curve.intervals(profile.places)
    push, squares = profile.pushes[:-1, None], np.square(profile.speeds)[:, None]
    ends = np.vstack((lower * push + bends * squares[:-1], upper * push + bends * squares[1:]))
    return float(np.max(abs(ends) / acceleration))


def _speed(curve: Curve, profile: Profile, velocity: Array) -> float:
    """Largest joint speed over its limit.

    Within an interval its square is p(s)^2 x(s) with p and x linear in s: largest at an end, or
    where 2 p' x + p x' = 0.
    """
    lower, _, p1 = curve.intervals(profile.places)
    squares, steps = np.square(profile.speeds)[:, None], np.diff(profile.places)[:, None]
    p0, x0, x1 = lower, squares[:-1], np.diff(squares, axis=0) / steps
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turn = -(2.0 * p1 * x0 + p0 * x1) / (3.0 * p1 * x1)
        turn = np.where(np.isfinite(turn), turn, 0.0)
    speeds = [
        abs(p0 + u * p1) * np.sqrt(np.maximum(0.0, x0 + u * x1)) / velocity
        for u in (0.0 * steps, np.clip(turn, 0.0, steps), steps)
    ]
    return float(np.max(speeds))


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
        ahead = upper + 2.0 * np.diff(grid)[:, None] * bends  # of u, with x there x + 2 step u
        a, b = np.hstack((lower, ahead)), np.hstack((bends, bends))
        a, b = np.vstack((a, a[-1:])), np.vstack((b, b[-1:]))  # no interval begins at the last
        both = np.concatenate((self._acceleration, self._acceleration))
        signs = np.vstack((np.eye(len(both)), -np.eye(len(both))))
        bounds = np.column_stack((np.zeros(len(grid)), self._fastest(lower, upper)))
        return a, b, np.zeros_like(a), signs, np.concatenate((both, both)), None, bounds

    def _fastest(self, lower: Array, upper: Array) -> Array:
        """Largest x at each point of the grid, from the intervals on both sides (K + 1,)."""
        steepest = np.vstack((abs(lower), np.zeros_like(lower[:1])))
        steepest[1:] = np.maximum(steepest[1:], abs(upper))
        with np.errstate(divide="ignore", over="ignore"):  # a joint that stands limits nothing
            speeds = np.min(self._velocity / steepest, axis=1)
        squares: Array = np.minimum(speeds, _FASTEST) ** 2
        return squares
