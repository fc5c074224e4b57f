"""Recordings of runs: writing, retention, reading and drawing.

Importing this room is cheap: the functions that use MCAP, rosbags, NumPy or matplotlib import them.
"""

from .errors import (
    DiskFull,
    LogError,
    NoSpace,
    RecordingError,
    RecordingExists,
    RecordingIncomplete,
    RecordingInUse,
    RecordingNotCreated,
    RecordingTruncated,
)
from .folder import check_space, recording_path
from .reading.file_state import closed_recordings
from .reading.reader import Message, read
from .reading.recording import Recording
from .records.records import (
    Attachment,
    Description,
    Feedback,
    Goal,
    Item,
    LogLine,
    NodeStatus,
    Note,
    Plan,
    Received,
    Record,
    Result,
    Schedule,
    Sent,
    Transition,
)
from .views.plot import plot
from .views.table import table
from .writing.compaction import Summary, compact
from .writing.recorder import Recorder
from .writing.recovery import recover, recover_all

__all__ = [
    "Attachment",
    "Description",
    "DiskFull",
    "Feedback",
    "Goal",
    "Item",
    "LogError",
    "LogLine",
    "Message",
    "NoSpace",
    "NodeStatus",
    "Note",
    "Plan",
    "Received",
    "Record",
    "Recorder",
    "Recording",
    "RecordingError",
    "RecordingExists",
    "RecordingInUse",
    "RecordingIncomplete",
    "RecordingNotCreated",
    "RecordingTruncated",
    "Result",
    "Schedule",
    "Sent",
    "Summary",
    "Transition",
    "check_space",
    "closed_recordings",
    "compact",
    "plot",
    "read",
    "recording_path",
    "recover",
    "recover_all",
    "table",
]
