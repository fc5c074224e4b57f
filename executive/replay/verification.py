"""Whether a recording shows a run that would be the same again: two verdicts, from its file alone.

Plan to frames: the recorded motion, compiled again, gives the frames that were sent. Goal to plan:
the recorded queries, planned again, give the recorded plans.
"""

import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from executive.codes import DIFFERS
from executive.recording.evidence import robot_of
from hardware import HardwareError, Robot
from logs import (
    Goal,
    LogError,
    NodeStatus,
    Plan,
    Record,
    Recording,
    RecordingError,
    RecordingInUse,
    RecordingTruncated,
    Result,
    Schedule,
    Sent,
)
from logs.reading.consistency import disagreement
from logs.reading.recovery import being_written
from logs.writing.compaction import RECOVERED
from skills.motion import ModelUnusable
from skills.motion.planner import Planner
from trees.compile.resolved import RESOLVED

from .difference import frames_difference, joints_difference, plans_difference
from .difference_result import result_difference
from .difference_source import PLANNING, changes, contradiction, source

_PLAN = "/plan/"
_FRAMES, _PLANS = "plan -> frames", "goal -> plan"


@dataclass(frozen=True, slots=True)
class Verdict:
    """An answer to one question.

    Attributes:
        question: Which.
        holds: Whether the recording and what was made anew are the same.
        words: What was compared, or the first difference.
        source: Where the difference comes from; empty where there is none.
    """

    question: str
    holds: bool
    words: str
    source: str = ""


@dataclass(frozen=True, slots=True)
class Verification:
    """What a recording proves.

    Attributes:
        path: The recording.
        verdicts: One per question; none where the file cannot be judged.
        error: Why it cannot, what is missing from it, or what was changed in it; empty otherwise.
        code: Stable name of that.
        motion: How long the motion was that was made again [s].
    """

    path: Path
    verdicts: tuple[Verdict, ...]
    error: str
    code: str
    motion: float

    @property
    def holds(self) -> bool:
        """Whether the file is whole, as it was, and both verdicts are that all is the same."""
        return not self.error and all(verdict.holds for verdict in self.verdicts)


def prove(path: Path) -> Verification:
    """Judge one recording. Plans in this process."""
    try:
        recording = Recording(path)
        story = list(recording.records(Sent, Schedule, Plan, Goal, Result, NodeStatus))
        if not recording.complete and being_written(path):
            raise RecordingInUse(path)
        verdicts = _verdicts(recording, story)
    except (LogError, HardwareError, ModelUnusable) as error:
        return Verification(path, (), str(error), error.code, 0.0)
    except OSError as error:
        return Verification(path, (), str(error), RecordingError.code, 0.0)
    motion = sum(record.duration for record in story if isinstance(record, Schedule))
    if not recording.complete:
        torn = RecordingTruncated(path, recording.messages)
        return Verification(path, verdicts, str(torn), torn.code, motion)
    if part := recording.changed:
        return Verification(path, verdicts, f"{part} was changed after the run", DIFFERS, motion)
    return Verification(path, verdicts, "", "", motion)


def prove_all(paths: Sequence[Path], jobs: int) -> Iterator[Verification]:
    """Judge recordings in processes of their own; the proofs come in the order of the paths."""
    # As the planners of a run: with one thread a sum is always added up in the same order.
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    pool = ProcessPoolExecutor(min(jobs, len(paths)), get_context("spawn"))
    try:
        yield from _without_ctrl_c(pool, paths)
    finally:
        pool.shutdown(cancel_futures=True)


def _without_ctrl_c(pool: ProcessPoolExecutor, paths: Sequence[Path]) -> Iterator[Verification]:
    """Begin, in processes that Ctrl-C never reaches: what is blocked stays so in a child."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return pool.map(prove, paths)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _verdicts(recording: Recording, story: Sequence[Record]) -> tuple[Verdict, ...]:
    topic, wrong = disagreement(recording)
    if not story and not _whole(recording):  # it may have been cut before its robot was told
        words = wrong or "nothing of a run is left, it was cut before"
        return tuple(Verdict(question, not wrong, words) for question in (_FRAMES, _PLANS))
    robot, planned = robot_of(recording), topic.startswith(_PLAN)
    return (
        _frames(recording, robot, story, "" if planned else wrong),
        _plans(recording, robot, story, wrong if planned else ""),
    )


def _whole(recording: Recording) -> bool:
    """Whether it tells of all that was recorded."""
    return recording.complete and RECOVERED not in recording.notes


def _frames(recording: Recording, robot: Robot, story: Sequence[Record], wrong: str) -> Verdict:
    words = _goal_difference(recording, story) or joints_difference(robot, story)
    words = words or frames_difference(robot, story, _whole(recording))
    words = words or result_difference(story) or wrong
    if words:
        return Verdict(_FRAMES, False, words, source(recording, robot, story, ("frames",)))
    schedules = sum(isinstance(record, Schedule) for record in story)
    frames = sum(isinstance(record, Sent) for record in story)
    return Verdict(_FRAMES, True, f"{_many(frames, 'frame')} of {_many(schedules, 'schedule')}")


def _goal_difference(recording: Recording, story: Sequence[Record]) -> str:
    """What is wrong with the goal; only a server's own recording has none, and nothing of a run."""
    goals = [record for record in story if isinstance(record, Goal)]
    if _whole(recording):
        ran = RESOLVED in recording.files or any(not isinstance(record, Sent) for record in story)
        if not recording.messages:
            return "nothing is recorded"
        if ran and not goals:
            return "no goal is recorded"
    return ""


def _plans(recording: Recording, robot: Robot, story: Sequence[Record], wrong: str) -> Verdict:
    words = joints_difference(robot, story)
    words = words or plans_difference(_planner(robot), robot, story, recording.files) or wrong
    if words:
        return Verdict(_PLANS, False, words, source(recording, robot, story, PLANNING))
    if cause := contradiction(recording, robot, story):
        return Verdict(_PLANS, False, "the plans are the same, what led to them is not", cause)
    plans = sum(isinstance(record, Plan) for record in story)
    new = changes(recording, PLANNING)
    return Verdict(_PLANS, True, _many(plans, "plan") + (f", also with {new}" if new else ""))


_planners: dict[str, Planner] = {}


def _planner(robot: Robot) -> Planner:
    """The planner for a robot, made once; the folder of its files is named by their content."""
    key = str(robot.path)
    if key not in _planners:
        _planners[key] = Planner(robot)
    return _planners[key]


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
