"""Whether a recording shows a run that would be the same again: two verdicts, from its file alone.

Plan to frames: the recorded motion, compiled again, gives the frames that were sent. Goal to plan:
the recorded queries, planned again, give the recorded plans.
"""

import os
import signal
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from executive.building.resolved import RESOLVED
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
    RecordingTruncated,
    Result,
    Schedule,
    Sent,
)
from logs.compaction import RECOVERED
from skills.motion import ModelUnusable
from skills.motion.planner import Planner

from .difference import frames_difference, plans_difference
from .difference_source import PLANNING, changes, contradiction, source


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
class Proof:
    """What a recording proves.

    Attributes:
        path: The recording.
        verdicts: One per question; none where the file cannot be judged.
        error: Why it cannot, or what is missing from it; empty otherwise.
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
        """Whether the file is whole and both verdicts are that all is the same."""
        return not self.error and all(verdict.holds for verdict in self.verdicts)


def prove(path: Path) -> Proof:
    """Judge one recording. Plans in this process."""
    try:
        recording = Recording(path)
        told = list(recording.stamped(Sent, Schedule, Plan, Goal, Result, NodeStatus))
        story = [record for _, record in told]
        robot = robot_of(recording)
        misdated = _stamps_difference(recording, told)
        verdicts = _frames(recording, robot, story, misdated), _plans(recording, robot, story)
    except (LogError, HardwareError, ModelUnusable) as error:
        return Proof(path, (), str(error), error.code, 0.0)
    except OSError as error:
        return Proof(path, (), str(error), RecordingError.code, 0.0)
    motion = sum(record.duration for record in story if isinstance(record, Schedule))
    if recording.complete:
        return Proof(path, verdicts, "", "", motion)
    torn = RecordingTruncated(path, recording.messages)
    return Proof(path, verdicts, str(torn), torn.code, motion)


def prove_all(paths: Sequence[Path], jobs: int) -> Iterator[Proof]:
    """Judge recordings in processes of their own; the proofs come in the order of the paths."""
    # As the planners of a run: with one thread a sum is always added up in the same order.
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    pool = ProcessPoolExecutor(min(jobs, len(paths)), get_context("spawn"))
    try:
        yield from _without_ctrl_c(pool, paths)
    finally:
        pool.shutdown(cancel_futures=True)


def _without_ctrl_c(pool: ProcessPoolExecutor, paths: Sequence[Path]) -> Iterator[Proof]:
    """Begin, in processes that Ctrl-C never reaches: what is blocked stays so in a child."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return pool.map(prove, paths)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _frames(recording: Recording, robot: Robot, story: Sequence[Record], misdated: str) -> Verdict:
    question = "plan -> frames"
    words = _goal_difference(recording, story) or frames_difference(robot, story) or misdated
    if words:
        return Verdict(question, False, words, source(recording, robot, story, ("frames",)))
    schedules = sum(isinstance(record, Schedule) for record in story)
    frames = sum(isinstance(record, Sent) for record in story)
    return Verdict(question, True, f"{_many(frames, 'frame')} of {_many(schedules, 'schedule')}")


def _stamps_difference(recording: Recording, told: Iterable[tuple[int, Record]]) -> str:
    """The first record that says it happened when its message does not; its reader goes by that."""
    for stamp, record in told:
        if stamp != recording.epoch_ns + round(record.time * 1e9):
            happened = (stamp - recording.epoch_ns) / 1e9
            return (
                f"a {type(record).__name__} is recorded at {record.time} s in a message of "
                f"{happened} s"
            )
    return ""


def _goal_difference(recording: Recording, story: Sequence[Record]) -> str:
    """What is wrong with the goal; only a server's own recording has none, and nothing of a run."""
    goals = [record for record in story if isinstance(record, Goal)]
    if recording.complete and RECOVERED not in recording.notes:
        ran = RESOLVED in recording.files or any(not isinstance(record, Sent) for record in story)
        if not recording.messages:
            return "nothing is recorded"
        if ran and not goals:
            return "no goal is recorded"
    for result in (record for record in story if isinstance(record, Result)):
        if (result.goal_id, result.task) not in {(goal.goal_id, goal.task) for goal in goals}:
            return f"the result is of task {result.task}, of which no goal is recorded"
    return ""


def _plans(recording: Recording, robot: Robot, story: Sequence[Record]) -> Verdict:
    question = "goal -> plan"
    wrong = contradiction(recording, robot, story)
    if words := plans_difference(_planner(robot), robot, story, recording.files):
        return Verdict(question, False, words, wrong or source(recording, robot, story, PLANNING))
    if wrong:
        return Verdict(question, False, "the plans are the same, what led to them is not", wrong)
    plans = sum(isinstance(record, Plan) for record in story)
    new = changes(recording, PLANNING)
    return Verdict(question, True, _many(plans, "plan") + (f", also with {new}" if new else ""))


_planners: dict[str, Planner] = {}


def _planner(robot: Robot) -> Planner:
    """The planner for a robot, made once; the folder of its files is named by their content."""
    key = str(robot.path)
    if key not in _planners:
        _planners[key] = Planner(robot)
    return _planners[key]


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
