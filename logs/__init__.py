"""Recordings of runs: writing, retention, reading and drawing.

Importing this package is fast: only the functions that use MCAP, NumPy or matplotlib import them.
"""

import typing

from hardware.loading.lazy_exports import lazy_exports

if typing.TYPE_CHECKING:
    from .errors import (
        DiskFull as DiskFull,
        FileKept as FileKept,
        LogError as LogError,
        NoSpace as NoSpace,
        NoSuchRecording as NoSuchRecording,
        RecordingCut as RecordingCut,
        RecordingError as RecordingError,
        RecordingExists as RecordingExists,
        RecordingIncomplete as RecordingIncomplete,
        RecordingInUse as RecordingInUse,
        RecordingNotCreated as RecordingNotCreated,
        RecordingTruncated as RecordingTruncated,
    )
    from .folder import check_space as check_space, recording_path as recording_path
    from .reading.file_state import closed_recordings as closed_recordings
    from .reading.find import find_recording as find_recording
    from .reading.reader import Message as Message, read as read
    from .reading.recording import Recording as Recording
    from .records.packing import pack as pack, unpack as unpack
    from .records.records import (
        HALTED as HALTED,
        MOVE as MOVE,
        Attachment as Attachment,
        Description as Description,
        Feedback as Feedback,
        Goal as Goal,
        Item as Item,
        LeaderState as LeaderState,
        LogLine as LogLine,
        Measured as Measured,
        NodeStatus as NodeStatus,
        Note as Note,
        Plan as Plan,
        Received as Received,
        Record as Record,
        Result as Result,
        Schedule as Schedule,
        Sent as Sent,
        Transition as Transition,
        goal_title as goal_title,
        shown_status as shown_status,
    )
    from .views.run_figure import plot as plot
    from .views.table import table as table
    from .writing.compaction import Summary as Summary
    from .writing.recorder import Recorder as Recorder
    from .writing.recovery import recover as recover, recover_all as recover_all
else:
    __getattr__ = lazy_exports(__name__)
