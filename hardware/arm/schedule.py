"""A motion as the frames that play it: sampled, encoded, thinned and spaced for the board."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from hardware.description.robot import Robot
from hardware.drivers.driver import Frame, WireFormat
from hardware.drivers.pacing import Pace
from hardware.errors import TooFast

# Rows of joint positions [rad] at the given times [s], one value per actuated joint.
Sampler = Callable[[Sequence[float]], Sequence[Sequence[float]]]

# What turns the servos by more than a frame may in less than this is a jump [s]; four hobby servos
# at full speed take six times as long.
_SHORTEST = 0.001


@dataclass(frozen=True, slots=True)
class Setpoint:
    """A frame and its time.

    Attributes:
        time: From the start of the motion [s].
        delay: How much later that is than planned, for the board's sake [s].
        positions: The joint values it stands for, one per actuated joint [rad].
        frame: What travels.
    """

    time: float
    delay: float
    positions: tuple[float, ...]
    frame: Frame


@dataclass(frozen=True, slots=True)
class Schedule:
    """The frames of a motion.

    Attributes:
        setpoints: Only frames that differ from the one before.
        end: Where the motion ends [rad]; it may lie in the last frame's bin, not at its sample.
        duration: Until the board is done with the last frame [s].
        slowed: How much longer the board makes it than it was planned [s].
    """

    setpoints: tuple[Setpoint, ...]
    end: tuple[float, ...]
    duration: float
    slowed: float


def compile_schedule(
    robot: Robot, start: Sequence[float], sample: Sampler, duration: float
) -> Schedule:
    """Turn a motion into the frames that play it.

    The motion is sampled on the firmware's grid. A frame goes out one period before the arm shall
    be there, for a board takes up to that long to get there. Where one grid step asks for more
    than one frame may, samples in between get periods of their own, so the motion takes longer
    there.

    Args:
        robot: Whose arm and board.
        start: Where the arm is commanded to stand, one value per actuated joint [rad].
        sample: The motion.
        duration: Of the motion as planned [s].

    Raises:
        BadPosition: A sample is missing, not finite or outside the limits.
        TooFast: The motion jumps, or does not begin where the arm is commanded to stand.
    """
    codec = robot.wire_format
    last = codec.encode(start)
    pace = Pace(robot.firmware, robot.serial.baud, last)
    period, setpoints, shift = 1 / robot.firmware.rate, [], 0.0
    end, periods = tuple(start), 0
    for number, (planned, end) in enumerate(_steps(robot, codec, start, sample, duration)):
        frame, periods = codec.encode(end), number + 1
        if frame != last:
            time = max(number * period + shift, pace.earliest)
            shift = time - number * period
            pace.sent(frame, time)
            setpoints.append(Setpoint(time, max(0.0, time - planned), end, frame))
            last = frame
    done = max(periods * period + shift, pace.done) if setpoints else 0.0
    late = done - math.ceil(duration / period - 1e-9) * period
    return Schedule(tuple(setpoints), end, done, max(0.0, late))


def servo_path(
    robot: Robot, start: Sequence[float], schedule: Schedule
) -> tuple[list[float], list[tuple[float, ...]]]:
    """The positions the servos really pass, one after the other along straight lines.

    They are those that the frames decode to, and a board that turns one servo after the other
    also stands at every corner in between.

    Args:
        robot: Whose board.
        start: Where the arm was commanded to stand, one value per actuated joint [rad].
        schedule: What is to be played.

    Returns:
        When the frame of each position goes out [s], and the positions, one value per actuated
        joint [rad].
    """
    codec, in_turn = robot.wire_format, robot.firmware.degree_time > 0
    held = list(codec.encode(start).servos)
    times, rows = [0.0], [codec.decode(codec.frame(held))]
    for setpoint in schedule.setpoints:
        for servo, angle in enumerate(setpoint.frame.servos):
            if held[servo] != angle:
                held[servo] = angle
                if in_turn:
                    rows.append(codec.decode(codec.frame(held)))
        if not in_turn:
            rows.append(codec.decode(setpoint.frame))
        times += [setpoint.time] * (len(rows) - len(times))
    return times, rows


def _steps(
    robot: Robot, codec: WireFormat, start: Sequence[float], sample: Sampler, duration: float
) -> Iterator[tuple[float, tuple[float, ...]]]:
    """The positions at the end of every period, as many periods as the board needs.

    With each comes when the period begins, as planned [s].
    """
    rate = robot.firmware.rate
    times = [min(k / rate, duration) for k in range(math.ceil(duration * rate - 1e-9) + 1)]
    before, before_time = codec.encode(start), 0.0
    for number, (time, row) in enumerate(zip(times[1:], sample(times)[1:], strict=True)):
        frame, parts = codec.encode(row), 1
        rows = [row]
        while not _fits(codec, before, rows, robot.firmware.max_step):
            parts += 1
            step = (time - before_time) / parts
            if step < _SHORTEST:
                raise _jump(before_time, time, robot.firmware.max_step)
            rows = [*sample([before_time + step * k for k in range(1, parts)]), row]
        for part, positions in enumerate(rows):
            yield (number + part / parts) / rate, tuple(float(q) for q in positions)
        before, before_time = frame, time


def _jump(start: float, end: float, most: int) -> TooFast:
    return TooFast(
        f"the motion jumps between {start:.3f} and {end:.3f} s: it turns the servos by more than "
        f"{most} degrees in sum within {_SHORTEST * 1000:g} ms. It must begin where the arm is "
        "commanded to stand, and go on without a gap"
    )


def _fits(codec: WireFormat, before: Frame, rows: Sequence[Sequence[float]], most: int) -> bool:
    servos = before.servos
    for row in rows:
        after = codec.encode(row).servos
        if sum(abs(b - a) for a, b in zip(servos, after, strict=True)) > most:
            return False
        servos = after
    return True
