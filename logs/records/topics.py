"""The table of topics. It defines the topics and message types of each record type."""

from collections.abc import Callable
from typing import Any

from hardware.loading.dataclass import dataclass

from . import conversions as as_
from .cdr import Message
from .records import (
    Description,
    Feedback,
    Goal,
    LeaderState,
    LogLine,
    Measured,
    NodeStatus,
    Plan,
    Received,
    Record,
    Result,
    Schedule,
    Sent,
    Transition,
)

_FRAME = "arduinobot_msgs/msg/SerialFrame"
_JSON = _TEXT = "std_msgs/msg/String"

Convert = Callable[[Any, as_.Stamp], Message | None]


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic in a recording: one row of the table `TOPICS`.

    Attributes:
        record: Type of the records that are written to the topic.
        name: Name of the topic. It may contain a field of the record, as `/plan/{record.group}`.
        type: ROS 2 message type.
        convert: Function that converts a record to a message, or to None for no message.
        latched: True if late subscribers get the last message (transient local).
    """

    record: type[Record]
    name: str
    type: str
    convert: Convert
    latched: bool = False

    @property
    def every_field(self) -> bool:
        """True if the message is JSON with all fields of the record, and the name is fixed."""
        return self.fixed and self.convert is as_.every_field

    @property
    def fixed(self) -> bool:
        """True if all records of the type are written to the same topic."""
        return "{" not in self.name

    def name_for(self, record: Record) -> str:
        """Return the topic's name for one record."""
        return self.name if self.fixed else self.name.format(record=record)


TOPICS = (
    Topic(Sent, "/serial/tx", _FRAME, as_.sent_frame),
    Topic(Sent, "/serial/timing", _JSON, as_.sent_timing),
    Topic(Sent, "/joint_states", "sensor_msgs/msg/JointState", as_.joint_state),
    Topic(Received, "/serial/rx", _FRAME, as_.received_bytes),
    Topic(Goal, "/goal", _JSON, as_.every_field, latched=True),
    Topic(Result, "/result", _JSON, as_.every_field, latched=True),
    Topic(Feedback, "/feedback", "arduinobot_msgs/msg/TaskFeedback", as_.percentage),
    Topic(Feedback, "/progress", _JSON, as_.every_field),
    Topic(NodeStatus, "/tree", _JSON, as_.every_field),
    Topic(Plan, "/plan/{record.group}", _JSON, as_.every_field, latched=True),
    Topic(
        Plan,
        "/plan/{record.group}/trajectory",
        "trajectory_msgs/msg/JointTrajectory",
        as_.trajectory,
        latched=True,
    ),
    Topic(Schedule, "/schedule", _JSON, as_.every_field, latched=True),
    Topic(Transition, "/lifecycle", "lifecycle_msgs/msg/TransitionEvent", as_.transition_event),
    Topic(LogLine, "/rosout", "rcl_interfaces/msg/Log", as_.log_message),
    Topic(Description, "/robot_description", _TEXT, as_.urdf, latched=True),
    Topic(Sent, "/tf", "tf2_msgs/msg/TFMessage", as_.transforms),
    Topic(Sent, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", as_.late_frame),
    Topic(
        Measured,
        "/joint_states/measured",
        "arduinobot_msgs/msg/MeasuredJoints",
        as_.measured_joints,
    ),
    Topic(
        LeaderState, "/leader/joint_states", "sensor_msgs/msg/JointState", as_.leader_joint_state
    ),
)


def topics_of(record_type: type) -> tuple[Topic, ...]:
    """Return the rows for one record type, in the order of the table."""
    return tuple(topic for topic in TOPICS if topic.record is record_type)


def offered_qos(topic: Topic) -> str:
    """Return the quality of service with which a player publishes the topic, as YAML of rosbag2.

    History is keep-last, and reliability is reliable. A latched topic is transient local with
    depth 1. Any other topic is volatile with depth 10.
    """
    return _QOS.format(depth=1 if topic.latched else 10, durability=1 if topic.latched else 2)


# Note for rosbag2. Every release of rosbag2 reads the quality of service as numbers, but only in a
# bag of version 8 or older. A file without this note counts as the newest version. rosbag2 uses
# only the version in this note, and reads everything else from the file itself.
ROSBAG2 = {
    "serialized_metadata": """\
version: 8
storage_identifier: mcap
duration:
  nanoseconds: 0
starting_time:
  nanoseconds_since_epoch: 0
message_count: 0
topics_with_message_count: []
compression_format: ""
compression_mode: ""
relative_file_paths: []
files: []
custom_data: {}
ros_distro: ""
"""
}

_QOS = """\
- history: 1
  depth: {depth}
  reliability: 1
  durability: {durability}
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"""
