"""Verifies from a recording alone that its run can be repeated exactly.

Plan to frames: the recorded motion, compiled again, must give the sent frames. Goal to plan: the
recorded queries, planned again, must give the recorded plans.
"""

import json
import os
import signal
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context, parent_process
from pathlib import Path

from executive.errors import ReplayDiffers
from executive.recording.archive import in_recording, restore_robot
from hardware import HardwareError
from hardware.loading.dataclass import dataclass
from hardware.printable import plural
from logs import (
    Goal,
    LogError,
    Measured,
    NodeStatus,
    Plan,
    Record,
    Recording,
    RecordingError,
    RecordingInUse,
    Result,
    Schedule,
    Sent,
)
from logs.reading.consistency import inconsistency
from logs.reading.file_state import why_incomplete
from skills.motion import ModelUnusable

from .cause import PLANNING, changes, contradiction, source
from .recorded_run import RecordedRun
from .verify_frames import frames_difference
from .verify_plans import plans_difference

_PLAN = "/plan/"
_FRAMES, _PLANS = "plan -> frames", "goal -> plan"
_NOTHING = "nothing to verify: "


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check.

    Attributes:
        question: Name of the check.
        holds: True if the recording equals the repeated result.
        words: The compared things, or the first difference.
        source: Source of the difference; empty if there is none.
        empty: True if there was nothing to compare.
    """

    question: str
    holds: bool
    words: str
    source: str = ""
    empty: bool = False


@dataclass(frozen=True, slots=True)
class Verification:
    """The result of verifying a recording.

    Attributes:
        path: The recording.
        checks: Both checks; empty if the file cannot be verified.
        error: Why the file cannot be verified, or its missing or changed part; else empty.
        code: Stable code of the error; empty if there is none.
        motion: Total duration of the motions that were compiled again [s].
    """

    path: Path
    checks: tuple[Check, ...]
    error: str
    code: str
    motion: float

    @property
    def holds(self) -> bool:
        """True if the file is complete and unchanged, and both checks hold."""
        return not self.error and all(check.holds for check in self.checks)

    def text(self) -> str:
        """Return the result in lines for people."""
        lines = [str(self.path)]
        for check in self.checks:
            verdict = "-" if check.empty else "holds" if check.holds else "DIFFERS"
            lines.append(f"  {check.question:<16}{verdict:<9}{check.words}")
            if check.source:
                lines.append(f"{'':<18}comes from {check.source}")
        if not self.error and all(check.empty for check in self.checks):
            lines.append("  the file is complete and unchanged, and its messages agree")
        if self.error:
            lines.append(f"  {self.error.removeprefix(f'{self.path}: ')}")
        return "\n".join(lines)

    def json(self) -> str:
        """Return the result as one JSON object."""
        facts = {
            "path": str(self.path),
            "verdicts": [asdict(check) for check in self.checks],
            "error": self.error,
            "code": self.code,
            "motion": self.motion,
            "holds": self.holds,
        }
        return json.dumps(facts)


def verify(path: Path) -> Verification:
    """Verify one recording. Plan in this process."""
    try:
        recording = Recording(path)
        records = tuple(recording.records(Sent, Schedule, Plan, Goal, Result, NodeStatus, Measured))
        if isinstance(cut := why_incomplete(recording), RecordingInUse):
            raise cut
        checks = _checks(recording, records)
    except (LogError, HardwareError, ModelUnusable) as error:
        return Verification(path, (), in_recording(str(error)), error.code, 0.0)
    except OSError as error:
        return Verification(path, (), str(error), RecordingError.code, 0.0)
    motion = sum(record.duration for record in records if isinstance(record, Schedule))
    words, code = (str(cut), cut.code) if cut else ("", "")
    if recording.complete and (part := recording.changed):
        words, code = f"{part} was changed or removed after the run", ReplayDiffers.code
    return Verification(path, checks, words, code, motion)


def verify_all(paths: Sequence[Path], jobs: int) -> Iterator[Verification]:
    """Verify recordings in several processes. Yield the results in the order of the paths.

    Args:
        paths: The recordings.
        jobs: Number of processes.
    """
    # One thread, as in the planners of a run, because then sums always have the same order.
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    processes = min(jobs, len(paths)), get_context("spawn")
    pool = ProcessPoolExecutor(*processes, initializer=_end_with_parent)
    try:
        yield from _without_ctrl_c(pool, paths)
    finally:
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    """End this process when its parent is killed. Else it would wait for the next path for ever."""
    parent = parent_process()
    assert parent

    def wait() -> None:
        parent.join()
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=wait, daemon=True).start()


def _without_ctrl_c(pool: ProcessPoolExecutor, paths: Sequence[Path]) -> Iterator[Verification]:
    """Start processes that ignore Ctrl-C. A child process inherits the signals blocked here."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return pool.map(verify, paths)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _checks(recording: Recording, records: tuple[Record, ...]) -> tuple[Check, ...]:
    topic, wrong = inconsistency(recording)
    if not records and not recording.whole:  # the recording may lack its robot
        words = wrong or f"{_NOTHING}the file was cut before the first record"
        checks = (_FRAMES, _PLANS)
        return tuple(Check(question, not wrong, words, empty=not wrong) for question in checks)
    run = RecordedRun(recording, records, restore_robot(recording))
    planned = topic.startswith(_PLAN)
    conflict = contradiction(run)
    frames = frames_difference(run) or ("" if planned else wrong)
    plans = run.joints_difference or plans_difference(run) or (wrong if planned else "")
    count = Counter(
        type(record) for record in records if not isinstance(record, Sent) or record.joints
    )
    if frames:
        first = Check(_FRAMES, False, frames, conflict or source(recording, ("frames",)))
    else:
        empty = not count[Sent] and not count[Schedule]
        words = f"{plural(count[Sent], 'frame')} of {plural(count[Schedule], 'schedule')}"
        words = f"{_NOTHING}the recording has no frame" if empty else words
        first = Check(_FRAMES, True, words, empty=empty)
    if plans:
        return first, Check(_PLANS, False, plans, conflict or source(recording, PLANNING))
    if conflict:
        words = "the plans are the same, but their inputs differ"
        return first, Check(_PLANS, False, words, conflict)
    if not count[Plan]:
        return first, Check(_PLANS, True, f"{_NOTHING}the recording has no plan", empty=True)
    new = changes(recording, PLANNING)
    also = f", also with {new}" if new else ""
    return first, Check(_PLANS, True, plural(count[Plan], "plan") + also)
