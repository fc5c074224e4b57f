"""Checks of a whole motion: of a timed plan, and of rows as the board will play them."""

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from skills.motion.arrays import Array
from skills.motion.collision.checker import CollisionChecker, Contact
from skills.motion.collision.start_contacts import StartContacts
from skills.motion.errors import BadQuery, MotionCollides, NotFinite, shown
from skills.motion.query import Verify
from skills.motion.trajectory.plan import Plan
from skills.motion.validation import MAX_MAGNITUDE, is_number

from .motion_validator import MIN_STEP, MotionValidator, uniform_travel

_SAMPLES = 200  # number of samples that bound the travel of a plan
_CHUNK = 500  # configurations between two checks of the deadline


def verify_plan(validator: MotionValidator, plan: Plan) -> None:
    """Check a plan with bends once more, over time.

    Each bend was checked before, so a collision here is an error of the planner. The plan must keep
    the guaranteed distance, like every checked path.

    A straight plan needs no second check. Its motion passes only through points of its line, up to
    rounding errors. The guaranteed distance was proved for all these points. Mimic joints move in
    proportion, so this holds for them too.

    Raises:
        MotionCollides: The plan is in collision.
    """
    validator = dataclasses.replace(validator, margin=validator.guaranteed, guaranteed=0.0)
    times = np.linspace(0.0, plan.duration, _SAMPLES)
    # Two bounds on the motion of a joint between two samples: full acceleration and deceleration,
    # and its velocity limit. Every plan keeps this limit to a thousandth.
    speeds, gain = abs(plan.velocities(times)), plan.acceleration * times[1]
    fastest = np.minimum(0.5 * (speeds[1:] + speeds[:-1] + gain), 1.001 * plan.velocity)
    travels = times[1] * fastest @ validator.lever_arms.T
    time_at, travels = uniform_travel(times, travels)
    share = validator.colliding_share(lambda shares: plan.sample(time_at(shares)), travels)
    if share is not None:
        time = float(time_at(np.array([share]))[0])
        row = validator.full(plan.sample((time,)))[0]
        contact = validator.checker.nearest(row)
        assert contact
        raise MotionCollides(0, time, *contact, validator.margin)


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
        MotionCollides: It does. The error has the first contact.
        PlanTimeout: The deadline passed.
    """
    rows = np.asarray(request.configurations)
    for chunk in _places(rows, contacts.lever_arms, MIN_STEP):
        if deeper := contacts.first_deeper(_interpolate(rows, chunk)):
            raise _collision(deeper[1], chunk[deeper[0]], request)


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
