"""The arm's sweep, and what is around it, from two sides."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

_START, _ARM, _BODY = "#777777", "#0072B2", "#D55E00"
_SIDES = ((0, 2), (0, 1))
_KEY = 0.15  # of the height, kept free for the key: to search for a free corner takes a second

Point = tuple[float, float]
Shape = Sequence[Sequence[float]]


@dataclass(frozen=True)
class Sweep:
    """What is drawn of a motion in space.

    Attributes:
        poses: By pose, the points around every shape of the arm, in the root frame [m].
        bodies: The points around everything that stands around it [m].
        held: By pose, the points around every body that moves with it [m].
    """

    poses: Sequence[Sequence[Shape]]
    bodies: Sequence[Shape]
    held: Sequence[Sequence[Shape]] = field(default=())


def draw_sweep(sides: Sequence[Axes], sweep: Sweep) -> None:
    """Draws all poses over each other: the first grey, the last blue, those between faint.

    Bodies are red, those that it holds too.

    Args:
        sides: Two, for the view from the front and that from above.
        sweep: What to draw.
    """
    for axes, (across, up) in zip(sides, _SIDES, strict=True):
        _side(axes, sweep, across, up)


def _side(axes: Axes, sweep: Sweep, across: int, up: int) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=6)
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"{'xyz'[across]} [m]", fontsize=7)
    axes.set_ylabel(f"{'xyz'[up]} [m]", fontsize=7)
    axes.set_title("sweep from the front" if up == 2 else "sweep from above", fontsize=7)
    for shapes, color, alpha in (
        (sweep.bodies, _BODY, 0.5),
        ([shape for pose in sweep.poses[1:-1] for shape in pose], _ARM, 0.06),
        ([shape for pose in sweep.poses[:1] for shape in pose], _START, 0.3),
        ([shape for pose in sweep.poses[1:][-1:] for shape in pose], _ARM, 0.3),
        ([shape for pose in sweep.held[1:-1] for shape in pose], _BODY, 0.06),
        ([shape for pose in (*sweep.held[:1], *sweep.held[1:][-1:]) for shape in pose], _BODY, 0.5),
    ):
        if not shapes:
            continue
        hulls = [_hull([(point[across], point[up]) for point in shape]) for shape in shapes]
        axes.add_collection(
            PolyCollection(hulls, facecolors=color, edgecolors=color, alpha=alpha, lw=0.3)
        )
    handles = [Patch(color=_START, alpha=0.5, label="start")]
    if len(sweep.poses) > 1:
        handles.append(Patch(color=_ARM, label="end"))
    if sweep.bodies or any(sweep.held):
        handles.append(Patch(color=_BODY, alpha=0.5, label="bodies"))
    drawn = axes.dataLim
    axes.update_datalim([(drawn.x0, drawn.y1 + _KEY * drawn.height)])
    axes.autoscale_view()
    axes.legend(handles=handles, fontsize=6, ncols=3, loc="upper right")


def _hull(points: Sequence[Point]) -> list[Point]:
    """Corners of the convex hull, in turn (A. M. Andrew's monotone chain, 1979)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return lower[:-1] + upper[:-1]


def _chain(points: Sequence[Point]) -> list[Point]:
    chain: list[Point] = []
    for x, y in points:
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            chain.pop()
        chain.append((x, y))
    return chain
