"""Checks a motion as the board will execute it, along straight lines from row to row."""

from collections.abc import Iterator, Sequence

import numpy as np

from skills.motion.arrays import Array
from skills.motion.collision.checker import CollisionChecker, Contact
from skills.motion.collision.start_contacts import StartContacts
from skills.motion.errors import BadQuery, MotionCollides, NotFinite, shown
from skills.motion.query import Verify
from skills.motion.validation import MAX_MAGNITUDE, is_number

from .motion_validator import MIN_STEP

_CHUNK = 500  # configurations between two checks of the deadline


def verify_rows(checker: CollisionChecker, request: Verify) -> None:
    """Check a motion along its rows, in steps that travel less than the margin.

    Args:
        checker: Checks configurations in the request's world, within its deadline.
        request: The motion.

    Raises:
        MotionCollides: The motion is in collision. The error has the first contact.
        BadQuery, NotFinite: The request is not valid.
        PlanTimeout: The deadline passed.
    """
    rows = _check_request(request, checker.scene.robot_model.joints)
    step = max(request.margin, MIN_STEP)
    if invalid := checker.first_invalid_contact(rows[:1], request.margin):
        raise _collision(invalid[1], 0.0, request)
    for chunk in _places(rows, checker.scene.lever_arms, step):
        points = _interpolate(rows, chunk)
        hit = checker.first_collision(points, request.margin)
        if hit is not None:
            contact = checker.nearest(points[hit])
            assert contact
            raise _collision(contact, chunk[hit], request)


def verify_contacts(contacts: StartContacts, request: Verify) -> None:
    """Check that a motion deepens no contact in which it starts.

    Raises:
        MotionCollides: The motion deepens a contact. The error has the first such contact.
        PlanTimeout: The deadline passed.
    """
    if deeper := first_deeper(contacts, np.asarray(request.configurations)):
        raise _collision(deeper[1], deeper[0], request)


def first_deeper(contacts: StartContacts, rows: Array) -> tuple[float, Contact] | None:
    """Return the first place at which a motion along rows (N, A) [rad] deepens a contact, or None.

    Returns:
        The place as a fractional row number, and the contact at this place.

    Raises:
        PlanTimeout: The deadline passed.
    """
    for chunk in _places(rows, contacts.lever_arms, MIN_STEP):
        if deeper := contacts.first_deeper(_interpolate(rows, chunk)):
            return float(chunk[deeper[0]]), deeper[1]
    return None


def _collision(contact: Contact, place: float, request: Verify) -> MotionCollides:
    """Return the error for a contact at a place: a fractional row number of a request."""
    rows, times = range(len(request.configurations)), request.times
    time = None if times is None else float(np.interp(place, rows, np.asarray(times)))
    return MotionCollides(int(place), time, *contact, request.margin)


def _places(rows: Array, lever_arms: Array, step: float) -> Iterator[Array]:
    """Yield the places to check as fractional row numbers from 0 to N - 1, in chunks."""
    travels = (abs(np.diff(rows, axis=0)) @ lever_arms.T).max(axis=1, initial=0.0)
    counts = np.append((travels / step).astype(int) + 1, 1)
    ends = np.cumsum(counts)
    for begin in range(0, int(ends[-1]), _CHUNK):
        numbers = np.arange(begin, min(begin + _CHUNK, int(ends[-1])))
        row = np.searchsorted(ends, numbers, side="right")
        yield row + (numbers - (ends - counts)[row]) / counts[row]


def _interpolate(rows: Array, places: Array) -> Array:
    before = places.astype(int)
    after = np.minimum(before + 1, len(rows) - 1)
    points: Array = rows[before] + (places - before)[:, None] * (rows[after] - rows[before])
    return points


def _check_request(request: Verify, joints: Sequence[str]) -> Array:
    rows, times, margin = np.asarray(request.configurations), request.times, request.margin
    if rows.ndim != 2 or rows.shape[1] != len(joints) or not len(rows):
        wanted = f"rows of {len(joints)} ({', '.join(joints)}), at least one"
        raise BadQuery(f"The configurations have the shape {rows.shape}; give {wanted}")
    if times is not None and np.shape(times) != (len(rows),):
        raise BadQuery(f"There are {np.size(times)} times for {len(rows)} rows; give one for each")
    if not is_number(margin, 0.0, MAX_MAGNITUDE):
        wanted = f"a number from 0 to {MAX_MAGNITUDE:g}"
        raise BadQuery(f"The margin is {shown(margin)} m; give {wanted}")
    for row, column in np.argwhere(~np.isfinite(rows)):
        raise NotFinite(f"row {row}", joints[column], float(rows[row, column]))
    for row, column in np.argwhere(abs(rows) > MAX_MAGNITUDE):
        what = f"Row {row} has {joints[column]} at {rows[row, column]:g}"
        limits = f"from {-MAX_MAGNITUDE:g} to {MAX_MAGNITUDE:g} rad or m"
        raise BadQuery(f"{what}; give a position {limits}")
    return rows
