"""TOPP-RA: computes the fastest time law of a curve by reachability analysis.

Hung Pham and Quang-Cuong Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", IEEE Transactions on Robotics 34 (2018). With x = (ds/dt)^2 and u = d2s/dt2,
the acceleration of a joint is q' u + q'' x. The grid contains every break of the curve, and u is
constant between two grid points. Between them, q' and x are linear in s and q'' is constant, so the
acceleration is linear in s. An interval therefore keeps an acceleration limit if both its ends keep
this limit, with the q'' of this interval. The speed q' sqrt(x) can be higher between two grid
points than at both points. If it exceeds its limit between them by more than 0.2 %, the bounds on x
are lowered, and the problem is solved again. At the end, the whole motion is slowed down by the
remaining excess.

Let y be the x at the upper end of an interval; then u = (y - x) / (2 step). Every limit is a strip
|a x + b y| <= c. All pairs (x, y) that keep the limits of an interval are a convex polygon with the
corner (0, 0). Two passes solve the problem exactly. The backward pass finds the largest x from
which the motion can still stop at the end of the curve. The forward pass finds the largest
reachable y below these bounds. The smallest x is always 0, because a motion that stands still keeps
every limit. At each grid point, a pass only computes the minimum of a few lines. Everything else is
computed for all intervals at once.
"""

import numpy as np

from skills.motion.arrays import Array
from skills.motion.trajectory.curve import Curve, Slopes
from skills.motion.trajectory.time_law import TimeLaw

_INTERVALS = 40  # approximate number of grid intervals per section
_MIN_INTERVALS = 6  # least number of grid intervals per piece
_MAX_SPEED = 1e3  # bound on ds/dt at the tip of a cusp, where all joints stand still [1/s]
_NEGLIGIBLE = 1e-12  # coefficients of a strip below this share of the other one count as 0
_MAX_STEPS = 100  # largest number of steps of Newton's method; it needs two or three
_MAX_SOLUTIONS = 4  # largest number of solutions, each with lower bounds than the previous one
_SLIGHTLY = 1.002  # if a speed exceeds its limit by at most this factor, no more solutions follow


def time_section(
    curve: Curve, breaks: Array, velocity: Array, acceleration: Array
) -> TimeLaw | None:
    """Return the fastest time law between two stops of a curve.

    Args:
        curve: The path.
        breaks: Breaks of the curve from one stop to the next stop, with both stops (M + 1,).
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].

    Returns:
        The time law; None if the motion would have to stop between the two stops.
    """
    grid = _grid(breaks, curve.intervals(breaks), velocity, acceleration)
    slopes = curve.intervals(grid)
    polygons = _Polygons(grid, slopes, acceleration)
    most = _max_squares(slopes, velocity)
    for _ in range(_MAX_SOLUTIONS):
        squares = polygons.solve(most)
        if not np.all(squares[1:] + squares[:-1] > 0.0):  # also true if one is NaN
            return None
        law = _time_law(grid, np.sqrt(squares))
        fast = _speed_ratios(law, slopes, velocity)
        if fast.max() <= _SLIGHTLY:
            break
        # At each grid point: the larger ratio of the two intervals that meet at this point.
        around = np.maximum([*fast, 1.0], [1.0, *fast])
        most = np.where(around > 1.0, np.minimum(most, squares / np.square(around)), most)
    hard = law.acceleration_ratios(slopes, acceleration).max()
    return law.slowed(max(1.0, float(fast.max()), float(np.sqrt(hard))))


class _Polygons:
    """The polygons of all (x, y) that keep the acceleration limits: one per interval of a grid.

    Args:
        grid: Ends of the intervals (K + 1,).
        slopes: Derivatives of the curve in the intervals.
        acceleration: Acceleration limits (J,) [rad/s2].
    """

    def __init__(self, grid: Array, slopes: Slopes, acceleration: Array) -> None:
        lower, upper, second = slopes
        double = 2.0 * np.diff(grid)[:, None]
        # The limits at the lower end of each interval, and those at its upper end.
        a = np.hstack((double * second - lower, -upper))
        b = np.hstack((lower, upper + double * second))
        c = double * np.hstack((acceleration, acceleration))
        x_slopes, self._x_widths = _strips(a, b, c)
        self._y_slopes, self._y_widths = _strips(b, a, c)
        self._x_lines = list(zip(x_slopes.tolist(), self._x_widths.tolist(), strict=True))
        self._y_lines = list(zip(self._y_slopes.tolist(), self._y_widths.tolist(), strict=True))

    def solve(self, most: Array) -> Array:
        """Return the largest x at each grid point; x is 0 at both ends of the grid (K + 1,).

        Args:
            most: Bounds on x (K + 1,).
        """
        top_x, top_y = self._vertices(most)
        highest = [0.0]
        for lines, x, y in zip(self._x_lines[::-1], top_x[::-1], top_y[::-1], strict=True):
            above = highest[-1]
            highest.append(x if above >= y else max(0.0, min(x, _lowest(lines, above))))
        reached = [0.0]
        for lines, top in zip(self._y_lines, highest[-2::-1], strict=True):
            reached.append(max(0.0, min(top, _lowest(lines, reached[-1]))))
        return np.array(reached)

    def _vertices(self, most: Array) -> tuple[list[float], list[float]]:
        """Return the largest x of each polygon, and the smallest y at this x, (K,) each.

        For each x, y has an upper bound, which is concave in x, and a lower bound, which is convex.
        Newton's method approaches the x at which the two bounds meet, from larger x.
        """
        rows, zeros = np.arange(len(most) - 1), np.zeros((len(most) - 1, 1))
        slopes = np.hstack((self._y_slopes, zeros))
        above = np.hstack((self._y_widths, most[1:, None]))
        below = np.hstack((-self._y_widths, zeros))
        # A strip with a negligible coefficient of y bounds only x.
        alone = np.where(np.isinf(self._y_widths), self._x_widths, np.inf).min(axis=1)
        x = np.minimum(most[:-1], alone)
        for _ in range(_MAX_STEPS):
            tops, bottoms = above - slopes * x[:, None], below - slopes * x[:, None]
            top, bottom = tops.argmin(axis=1), bottoms.argmax(axis=1)
            steeper = slopes[rows, top] - slopes[rows, bottom]
            apart = (tops[rows, top] < bottoms[rows, bottom]) & (steeper > 0.0)
            if not apart.any():
                break
            meet = (above[rows, top] - below[rows, bottom]) / np.where(apart, steeper, 1.0)
            smaller = np.where(apart, np.minimum(meet, x), x)
            if np.array_equal(smaller, x):
                break
            x = smaller
        y = (below - slopes * x[:, None]).max(axis=1)
        return x.tolist(), y.tolist()


def _lowest(lines: tuple[list[float], list[float]], place: float) -> float:
    """Return the smallest value of several lines, given by slopes and widths, at a place."""
    return min([width - slope * place for slope, width in zip(*lines, strict=True)])


def _strips(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Return slopes and widths (K, N) that write |a x + b y| <= c as |x + slope * y| <= width.

    If the coefficient of x is negligible, the width is infinite.
    """
    used = abs(a) > _NEGLIGIBLE * abs(b)
    divisor = np.where(used, a, 1.0)
    with np.errstate(over="ignore"):
        return np.where(used, b / divisor, 0.0), np.where(used, c / abs(divisor), np.inf)


def _max_squares(slopes: Slopes, velocity: Array) -> Array:
    """Return the largest squared path speed at each grid point (K + 1,)."""
    steepest = np.vstack((abs(slopes.lower), np.zeros_like(slopes.lower[:1])))
    steepest[1:] = np.maximum(steepest[1:], abs(slopes.upper))
    with np.errstate(divide="ignore", over="ignore"):  # a joint that does not move has no bound
        speeds = np.min(velocity / steepest, axis=1)
    squares: Array = np.minimum(speeds, _MAX_SPEED) ** 2
    return squares


def _grid(breaks: Array, pieces: Slopes, velocity: Array, acceleration: Array) -> Array:
    """Return the grid: all breaks, evenly spaced points between them, and two more points.

    The two points are the end of the acceleration at the start, and the start of the deceleration
    at the end. With them, the time law is exact on the lines at both ends.
    """
    even = _even_grid(breaks)
    lower, upper, second = pieces
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


def _speed_ratios(law: TimeLaw, slopes: Slopes, velocity: Array) -> Array:
    """Return for each interval the largest joint speed, as a share of its limit (K,).

    In an interval, the squared speed is p(s)^2 x(s), where p and x are linear in s. The maximum is
    at an end of the interval, or at the s for which 2 p' x + p x' = 0.
    """
    p0, _, p1 = slopes
    squares, steps = np.square(law.speeds)[:, None], np.diff(law.positions)[:, None]
    x0, x1 = squares[:-1], np.diff(squares, axis=0) / steps
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turn = -(2.0 * p1 * x0 + p0 * x1) / (3.0 * p1 * x1)
        turn = np.where(np.isfinite(turn), turn, 0.0)
    speeds = [
        abs(p0 + u * p1) * np.sqrt(np.maximum(0.0, x0 + u * x1)) / velocity
        for u in (0.0 * steps, np.clip(turn, 0.0, steps), steps)
    ]
    ratios: Array = np.max(speeds, axis=(0, 2))
    return ratios
