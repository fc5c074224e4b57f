"""Draws a motion of the arm, and the bodies around the arm, from the front and from above."""

from collections.abc import Sequence
from dataclasses import field
from itertools import chain

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from hardware.loading.dataclass import dataclass

_START, _ARM, _BODY = "#777777", "#0072B2", "#D55E00"
_SIDES = ((0, 2), (0, 1))
_KEY = 0.15  # share of the height for the legend; matplotlib takes 1 s to find a place itself

Point = tuple[float, float]
Shape = Sequence[Sequence[float]]


@dataclass(frozen=True, slots=True)
class MotionDrawing:
    """Outlines of the arm and of all bodies during a motion, in the root frame.

    Attributes:
        poses: For each pose of the motion, the corners of each shape of the arm [m].
        bodies: Corners of each body that does not move [m].
        held: For each pose, the corners of each body that the arm carries [m].
        hollow: Corners of each body that does not move and may contain the arm, such as a room [m].
    """

    poses: Sequence[Sequence[Shape]]
    bodies: Sequence[Shape]
    held: Sequence[Sequence[Shape]] = field(default=())
    hollow: Sequence[Shape] = field(default=())


def draw_motion(sides: Sequence[Axes], motion: MotionDrawing) -> None:
    """Draw all poses of a motion: the first pose grey, the last pose blue, the others pale blue.

    Bodies are orange; of a hollow one, only the outline is drawn.

    Args:
        sides: Axes for the view from the front, and for the view from above.
        motion: The motion to draw.
    """
    for axes, (across, up) in zip(sides, _SIDES, strict=True):
        _side(axes, motion, across, up)


def _side(axes: Axes, motion: MotionDrawing, across: int, up: int) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=6)
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"{'xyz'[across]} [m]", fontsize=7)
    axes.set_ylabel(f"{'xyz'[up]} [m]", fontsize=7)
    axes.set_title("motion from the front" if up == 2 else "motion from above", fontsize=7)
    for shapes, color, alpha in (
        (motion.hollow, _BODY, 0.0),
        (motion.bodies, _BODY, 0.5),
        (list(chain(*motion.poses[1:-1])), _ARM, 0.06),
        (list(chain(*motion.poses[:1])), _START, 0.3),
        (list(chain(*motion.poses[1:][-1:])), _ARM, 0.3),
        (list(chain(*motion.held[1:-1])), _BODY, 0.06),
        (list(chain(*motion.held[:1], *motion.held[1:][-1:])), _BODY, 0.5),
    ):
        if not shapes:
            continue
        hulls = [_hull([(point[across], point[up]) for point in shape]) for shape in shapes]
        axes.add_collection(
            PolyCollection(
                hulls,
                facecolors=(color, alpha),
                edgecolors=(color, alpha or 1.0),
                lw=0.3 if alpha else 1.0,
            )
        )
    handles = [Patch(color=_START, alpha=0.5, label="start")]
    if len(motion.poses) > 1:
        handles.append(Patch(color=_ARM, label="end"))
    if motion.bodies or motion.hollow or any(motion.held):
        handles.append(Patch(color=_BODY, alpha=0.5, label="bodies"))
    drawn = axes.dataLim
    axes.update_datalim([(drawn.x0, drawn.y1 + _KEY * drawn.height)])
    axes.autoscale_view()
    axes.legend(handles=handles, fontsize=6, ncols=3, loc="upper right")


def _hull(points: Sequence[Point]) -> list[Point]:
    """Return the corners of the convex hull in order around it (A. M. Andrew, 1979)."""
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
