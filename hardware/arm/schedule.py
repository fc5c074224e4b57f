"""Schedules: a motion as timed frames. Their spacing lets the board keep up."""

import math
from collections.abc import Callable, Iterator, Sequence

from hardware.description.robot import Robot
from hardware.drivers.pacing import PacingModel
from hardware.drivers.wire_format import Frame, WireFormat
from hardware.errors import ScheduleTooLong, TooFast
from hardware.loading.dataclass import dataclass

# Function from times [s] to joint positions [rad], one row per time.
Sampler = Callable[[Sequence[float]], Sequence[Sequence[float]]]

MAX_DURATION = 600.0  # largest duration of a motion, which bounds the memory for samples [s]

# Shortest time of a step [s]. A motion that needs several frames within this time is a jump. Hobby
# servos at full speed need six times as long for the largest turn of one frame.
_SHORTEST_STEP = 0.001


@dataclass(frozen=True, slots=True)
class Setpoint:
    """A frame of a motion, with its time and joint positions.

    Attributes:
        time: Time of the frame from the start of the motion [s].
        delay: Delay of the frame after its planned time, because the board is busy [s].
        positions: Joint positions of the frame, one per actuated joint [rad].
        frame: The frame.
    """

    time: float
    delay: float
    positions: tuple[float, ...]
    frame: Frame


@dataclass(frozen=True, slots=True)
class Schedule:
    """The frames of a motion.

    Attributes:
        setpoints: The frames. Each frame differs from the previous one.
        end: Joint positions at the end of the motion [rad]. They encode to the frame of the last
            setpoint, but may differ from its positions.
        duration: Time until the board has executed the last frame [s].
        slowed: Time by which the board makes the motion longer than planned [s].
        continues: True if another schedule follows at once. The joints need not reach the end.
    """

    setpoints: tuple[Setpoint, ...]
    end: tuple[float, ...]
    duration: float
    slowed: float
    continues: bool = False


def compile_schedule(
    robot: Robot, start: Sequence[float], sample: Sampler, duration: float
) -> Schedule:
    """Convert a motion to the frames that play it.

    The motion is sampled at the frame rate of the firmware. A frame is sent one period before the
    arm must reach its positions, because the board takes up to one period to execute it. A step
    that is too large for one frame is divided, and the motion takes longer.

    Args:
        robot: The robot.
        start: Commanded positions at the start, one per actuated joint [rad].
        sample: The motion.
        duration: Planned duration of the motion [s].

    Raises:
        BadPosition: A sample is missing, not finite or outside the limits.
        ScheduleTooLong: The duration is more than `MAX_DURATION`.
        TooFast: The motion jumps, or does not begin at the commanded positions.
    """
    if not duration <= MAX_DURATION:
        raise ScheduleTooLong(duration, MAX_DURATION)
    codec = robot.wire_format
    last = codec.encode(start)
    pacing = PacingModel(robot.firmware, robot.serial.baud, last)
    period, setpoints, shift = 1 / robot.firmware.rate, [], 0.0
    end, periods = tuple(start), 0
    for number, (planned, end) in enumerate(_steps(robot, codec, start, sample, duration)):
        frame, periods = codec.encode(end), number + 1
        if frame != last:
            time = max(number * period + shift, pacing.earliest)
            shift = time - number * period
            pacing.note_sent(frame, time)
            setpoints.append(Setpoint(time, max(0.0, time - planned), end, frame))
            last = frame
    done = max(periods * period + shift, pacing.done) if setpoints else 0.0
    late = done - math.ceil(duration / period - 1e-9) * period
    return Schedule(tuple(setpoints), end, done, max(0.0, late))


def servo_path(
    robot: Robot, start: Sequence[float], schedule: Schedule
) -> tuple[list[float], list[tuple[float, ...]]]:
    """Return the path that the servos follow when the board plays a schedule.

    The waypoints are the positions that the frames decode to. If the board turns one servo after
    the other, the position after each turn is also a waypoint. The servos move in straight lines
    between waypoints.

    Args:
        robot: The robot.
        start: Commanded positions at the start, one per actuated joint [rad].
        schedule: The schedule.

    Returns:
        The time of each waypoint's frame [s], and the waypoints, one position per actuated joint
        [rad].
    """
    codec, one_by_one = robot.wire_format, robot.firmware.unit_time > 0
    angles = list(codec.encode(start).servos)
    times, waypoints = [0.0], [codec.decode(codec.frame(angles))]
    for setpoint in schedule.setpoints:
        for servo, angle in enumerate(setpoint.frame.servos):
            if angles[servo] != angle:
                angles[servo] = angle
                if one_by_one:
                    waypoints.append(codec.decode(codec.frame(angles)))
        if not one_by_one:
            waypoints.append(codec.decode(setpoint.frame))
        times += [setpoint.time] * (len(waypoints) - len(times))
    return times, waypoints


def _steps(
    robot: Robot, codec: WireFormat, start: Sequence[float], sample: Sampler, duration: float
) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Yield the planned start of every period [s] and the positions at its end [rad].

    A step that is too large for one frame gets several periods.
    """
    rate, max_step = robot.firmware.rate, robot.firmware.max_step
    times = [min(k / rate, duration) for k in range(math.ceil(duration * rate - 1e-9) + 1)]
    before, before_time = codec.encode(start), 0.0
    for number, (time, row) in enumerate(zip(times[1:], sample(times)[1:], strict=True)):
        frame, parts = codec.encode(row), 1
        rows = [row]
        while not _fits(codec, before, rows, max_step):
            parts += 1
            step = (time - before_time) / parts
            if step < _SHORTEST_STEP:
                raise TooFast(
                    f"the motion jumps between {before_time:.3f} and {time:.3f} s: it turns the "
                    f"servos by more than {max_step} {robot.firmware.words.unit} in total within "
                    f"{_SHORTEST_STEP * 1000:g} ms. It must begin at the commanded positions and "
                    "be continuous"
                )
            rows = [*sample([before_time + step * k for k in range(1, parts)]), row]
        for part, positions in enumerate(rows):
            yield (number + part / parts) / rate, tuple(float(q) for q in positions)
        before, before_time = frame, time


def _fits(codec: WireFormat, before: Frame, rows: Sequence[Sequence[float]], max_step: int) -> bool:
    """Return True if one frame can reach each row from the previous row."""
    servos = before.servos
    for row in rows:
        after = codec.encode(row).servos
        if sum(abs(b - a) for a, b in zip(servos, after, strict=True)) > max_step:
            return False
        servos = after
    return True
