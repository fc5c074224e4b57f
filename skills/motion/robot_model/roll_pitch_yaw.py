"""Computes the turn of a tool in place by roll, pitch and yaw."""

import math

import numpy as np

from skills.motion.arrays import Array
from skills.motion.world import Vector

_UP = np.array((0.0, 0.0, 1.0))
# Largest error of a turn, as a share of its angle. Arms with five joints rarely turn a tool exactly
# about its own axis.
_SHARE = 0.05
# Sine of the angle to the vertical below which an axis has no side. The angle is well above the
# resolution of servos, so that rounding does not decide the direction of a pitch.
_STEEP = math.sin(math.radians(1.0))
_ABOVE = 1e-3  # a tool nearer to the vertical through the base is not ahead of it [m]
_BACK = -0.5  # cosine of the angle between ahead and a tool that points back at the base


def axes_across(axis: Array) -> Array:
    """Return two axes that define a tool's orientation: its axis, and a perpendicular one (2, 3).

    Args:
        axis: Axis of the tool, of length 1 (3,).
    """
    across = np.cross(axis, np.eye(3)[abs(axis).argmin()])
    return np.array((axis, across / np.linalg.norm(across)))


def turned(axes: Array, turn: Vector, tool: Array, wrist: Array, base: Array) -> Array:
    """Return two axes of a tool after a turn, in the root frame (2, 3).

    The pitch is about the horizontal line perpendicular to the tool's axis. A positive pitch is
    upwards. For a tool that points back at the base, within 60 deg, it is downwards: this continues
    a pitch beyond the vertical, so that the opposite pitch brings the tool back. If the tool's axis
    is within 1 deg of the vertical, the line is perpendicular to the arm.

    Args:
        axes: Axes from `axes_across` in the root frame before the turn, of length 1 (2, 3).
        turn: Roll about the tool's axis, then pitch, then yaw about the vertical [rad].
        tool: Position of the tool (3,) [m].
        wrist: Position of the last joint that moves the tool (3,) [m].
        base: Position of the first joint that moves the tool (3,) [m].
    """
    # Not the tool itself: it may be beside the axis of the wrist, and then beside the arm's plane.
    ahead = wrist + (tool - wrist) @ axes[0] * axes[0] - base
    side, across = np.cross(axes[0], _UP), np.cross(ahead, _UP)
    if np.linalg.norm(side) < _STEEP:
        side = across if np.linalg.norm(across) > _ABOVE else axes[1]
    elif side @ across < _BACK * np.linalg.norm(side) * np.linalg.norm(across):
        side = -side
    for line, angle in zip((axes[0], side / np.linalg.norm(side), _UP), turn, strict=True):
        axes = _rotated(axes, line, angle)
    return axes


def turn_tolerance(axes: Array, targets: Array) -> float:
    """Return the largest angle between an axis and its target that counts as reached [rad].

    Args:
        axes: The axes before the turn, of length 1 (2, 3).
        targets: The result of `turned`.
    """
    chord = float(np.linalg.norm(axes - targets, axis=1).max())
    return _SHARE * 2.0 * math.asin(min(1.0, 0.5 * chord))


def _rotated(vectors: Array, line: Array, angle: float) -> Array:
    """Return vectors (N, 3) after a rotation about a line of length 1 (O. Rodrigues 1840)."""
    along = np.outer(vectors @ line, line)
    cos, sin = np.cos(angle), np.sin(angle)
    rotated: Array = along + cos * (vectors - along) + sin * np.cross(line, vectors)
    return rotated
