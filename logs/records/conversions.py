"""Functions that convert a record to its message in the file: one function per topic."""

import json
from dataclasses import fields
from typing import Any, NamedTuple
from uuid import UUID

from hardware.description.forward_kinematics import ForwardKinematics, LinkTransform
from hardware.printable import wire_text

from .cdr import Message
from .records import (
    QUANTITIES,
    Description,
    Feedback,
    LeaderState,
    LogLine,
    Measured,
    Plan,
    Received,
    Record,
    Sent,
    Transition,
)
from .ros_lifecycle import STATE_NUMBERS, transition_number

_TX, _RX = 0, 1
LATE = 0.02  # smallest reported delay of a frame [s]
_LOWEST_LEVEL, _HIGHEST_LEVEL = 10, 50
MAX_TEXT = 20_000  # longer texts of skills and logs are cut before recording [characters]


class Stamp(NamedTuple):
    """Values that a message needs and its record does not contain.

    Attributes:
        time_ns: Time of the message, UTC since 1970 [ns].
        sequence: Number of earlier messages on the same topic.
        kinematics: Forward kinematics of the robot, or None before its URDF is recorded.
    """

    time_ns: int
    sequence: int
    kinematics: ForwardKinematics | None = None


class Timing(NamedTuple):
    """Values of a sent frame for which the message type SerialFrame has no field.

    Attributes:
        seq: Field `seq` of the message on `/serial/tx` that has the bytes of the frame.
        time: Time of writing the frame [s].
        scheduled: Planned time of the frame [s]; null for a frame without a schedule.
        hold: True if the frame is a hold: a stop repeated the previous frame.
        setting: True if the bytes are a board setting, which commands no joint.
    """

    seq: int
    time: float
    scheduled: float | None
    hold: bool
    setting: bool


def sent_frame(sent: Sent, stamp: Stamp) -> Message:
    """Return the written bytes of a frame as a SerialFrame message."""
    return _serial_frame(sent.data, _TX, stamp)


def received_bytes(received: Received, stamp: Stamp) -> Message:
    """Return bytes that were read as a SerialFrame message."""
    return _serial_frame(received.data, _RX, stamp)


def sent_timing(sent: Sent, stamp: Stamp) -> Message:
    """Return the `Timing` of a frame as JSON, in a String message."""
    timing = Timing(stamp.sequence, sent.time, sent.scheduled, sent.hold, not sent.joints)
    return _string(timing._asdict())


def joint_state(sent: Sent, stamp: Stamp) -> Message | None:
    """Return the commanded positions [rad] as a JointState message; None for a board setting."""
    return _joint_state(sent, _header(stamp)) if sent.joints else None


def leader_joint_state(leader: LeaderState, stamp: Stamp) -> Message:
    """Return the measured positions of the leader [rad] as a JointState message."""
    return _joint_state(leader, _header(stamp, "measured"))


def measured_joints(measured: Measured, stamp: Stamp) -> Message:
    """Return the measured values of the joints as a MeasuredJoints message."""
    return Message(
        name=list(measured.joints),
        **{each: getattr(measured, each) for each in QUANTITIES},
    )


def urdf(description: Description, stamp: Stamp) -> Message:
    """Return the robot's URDF as a String message."""
    return Message(data=description.urdf)


def transforms(sent: Sent, stamp: Stamp) -> Message | None:
    """Return the poses of all links as a TFMessage; None without a URDF, or for a board setting."""
    if stamp.kinematics is None or not sent.joints:
        return None
    links = stamp.kinematics.transforms(dict(zip(sent.joints, sent.positions, strict=True)))
    return Message(transforms=[_transform(link, stamp) for link in links])


def late_frame(sent: Sent, stamp: Stamp) -> Message | None:
    """Return a DiagnosticArray message if a frame was sent late, else None."""
    late = sent.time - sent.scheduled if sent.scheduled is not None else 0.0
    if late <= LATE:
        return None
    value = Message(key="late_ms", value=f"{late * 1e3:.3f}")
    status = Message(
        level=1,
        name="streamer",
        message=f"a frame was sent {late * 1e3:.1f} ms late",
        hardware_id="",
        values=[value],
    )
    header = _header(stamp)
    return Message(header=header, status=[status])


def every_field(record: Record, stamp: Stamp) -> Message:
    """Return all fields of a record as JSON, in a String message. Long texts are cut."""
    named = {field.name: getattr(record, field.name) for field in fields(record)}
    return _string({k: _cut(v) if isinstance(v, str) else v for k, v in named.items()})


def trajectory(plan: Plan, stamp: Stamp) -> Message | None:
    """Return the sampled motion as a JointTrajectory message; None if no motion was found."""
    if not plan.times:
        return None
    return Message(
        header=_header(stamp),
        joint_names=list(plan.joints),
        points=[_point(t, q) for t, q in zip(plan.times, plan.positions, strict=True)],
    )


def percentage(feedback: Feedback, stamp: Stamp) -> Message:
    """Return the progress of a goal as a TaskFeedback message."""
    goal_id = UUID(feedback.goal_id).bytes
    return Message(
        goal_id=Message(uuid=goal_id),
        percentage=feedback.percentage or 0,  # an int32 cannot be None
    )


def transition_event(change: Transition, stamp: Stamp) -> Message:
    """Return a transition as a TransitionEvent message. Its id is 0 if the state did not change."""
    return Message(
        timestamp=stamp.time_ns,
        transition=Message(id=transition_number(change.start, change.label), label=change.label),
        start_state=_state(change.start),
        goal_state=_state(change.goal),
    )


def log_message(line: LogLine, stamp: Stamp) -> Message:
    """Return a log line as a Log message. Its level is rounded down to a level of ROS 2."""
    level = min(max(line.level // 10 * 10, _LOWEST_LEVEL), _HIGHEST_LEVEL)
    return Message(
        stamp=_time(stamp.time_ns),
        level=level,
        name=_text(line.logger),
        msg=_text(line.message),
        file="",
        function="",
        line=0,
    )


def _serial_frame(data: bytes, direction: int, stamp: Stamp) -> Message:
    return Message(seq=stamp.sequence, direction=direction, data=data, text=wire_text(data))


def _joint_state(record: Sent | LeaderState, header: Message) -> Message:
    return Message(
        header=header,
        name=list(record.joints),
        position=record.positions,
        velocity=(),
        effort=(),
    )


def _string(facts: dict[str, Any]) -> Message:
    return Message(data=json.dumps(facts, separators=(",", ":")))


def _text(value: str) -> str:
    """Return a text that all ROS tools can read: short, without lone surrogates and NUL."""
    clean = _cut(value).encode("utf-8", "backslashreplace").decode("utf-8")
    return clean.replace("\0", "\\x00")


def _cut(text: str) -> str:
    return text if len(text) <= MAX_TEXT else f"{text[:MAX_TEXT]} ..."


def _header(stamp: Stamp, frame: str = "") -> Message:
    return Message(stamp=_time(stamp.time_ns), frame_id=frame)


def _transform(link: LinkTransform, stamp: Stamp) -> Message:
    x, y, z = link.position
    qx, qy, qz, qw = link.rotation
    return Message(
        header=_header(stamp, link.parent),
        child_frame_id=link.child,
        transform=Message(
            translation=Message(x=x, y=y, z=z),
            rotation=Message(x=qx, y=qy, z=qz, w=qw),
        ),
    )


def _time(time_ns: int) -> Message:
    seconds, rest = divmod(time_ns, 10**9)
    return Message(sec=seconds, nanosec=rest)


def _point(time: float, positions: tuple[float, ...]) -> Message:
    seconds, rest = divmod(round(time * 1e9), 10**9)
    return Message(
        positions=positions,
        velocities=(),
        accelerations=(),
        effort=(),
        time_from_start=Message(sec=seconds, nanosec=rest),
    )


def _state(label: str) -> Message:
    return Message(id=STATE_NUMBERS.get(label, 0), label=label)
