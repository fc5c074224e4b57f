"""Returns a topic of a recording as NumPy arrays, and writes a recording to CSV files."""

import csv
import warnings
from collections.abc import Iterator
from itertools import chain
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hardware.spelling import closest
from logs.errors import RecordingError, RecordingTruncated
from logs.reading.reader import Message, read
from logs.reading.recording import Recording
from logs.records.cdr import Message as Values
from logs.records.records import QUANTITIES, LeaderState, Measured, Sent

if TYPE_CHECKING:
    from numpy.typing import NDArray

_PLAIN = (bool, int, float, str)
# Last part of the names of columns: the unit. A quantity without a unit has its own name instead.
_SUFFIXES = {
    "position": "rad",
    "velocity": "rad_s",
    "temperature": "celsius",
    "voltage": "volt",
    "current": "ampere",
}


def table(path: Path | str, topic: str) -> "dict[str, NDArray[Any]]":
    """Return the messages of a topic as columns, for `pandas.DataFrame`. A message is a row.

    Joint states have one column per joint [rad]. Other messages have one column per field, also per
    nested field, such as `transition.label`. Fields with arrays are left out. Unknown numbers are
    NaN. For an incomplete recording, the function warns and returns the valid part.

    Args:
        path: The recording.
        topic: Name of the topic, such as `/joint_states`.

    Returns:
        Columns by name: arrays of equal length. The first column is `time_ns`, UTC since 1970
        [ns]. Empty if the topic has no message.

    Raises:
        RecordingError: The recording cannot be read, or has no such topic.
    """
    import numpy as np

    from logs.records.topics import TOPICS

    rows, seen = [], set()
    try:
        for message in read(Path(path)):
            seen.add(message.topic)
            if message.topic == topic:
                rows.append({"time_ns": message.time_ns, **_row(message)})
    except RecordingTruncated as error:
        warnings.warn(str(error), stacklevel=2)
    known = seen | {each.name for each in TOPICS if each.fixed}
    if topic not in known:
        near = closest(topic, known, cutoff=0.0)
        raise RecordingError(Path(path), f"has no topic {topic}; the nearest is {near}")
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array(_column([row.get(name) for row in rows])) for name in names}


def _column(values: list[Any]) -> list[Any]:
    """Return a column with NaN in place of None. A column of texts is not changed."""
    if any(isinstance(value, str) for value in values):
        return values
    return [nan if value is None else value for value in values]


def _row(message: Message) -> dict[str, Any]:
    data = message.data
    if message.type == "sensor_msgs/msg/JointState":
        return dict(zip(data.name, data.position, strict=True))
    if message.type == "std_msgs/msg/String" and data.data.startswith("{"):
        values = message.fields()
        return {name: v for name, v in values.items() if v is None or isinstance(v, _PLAIN)}
    return dict(_flat(data, ""))


def _flat(data: Any, above: str) -> Iterator[tuple[str, Any]]:
    """Yield the name and value of each number, bool and text in a message and nested messages."""
    for name, value in vars(data).items():
        if isinstance(value, Values):
            yield from _flat(value, f"{above}{name}.")
        elif isinstance(value, _PLAIN):
            yield above + name, value


def export(path: Path, folder: Path) -> tuple[Path, ...]:
    """Write a recording to CSV files. Their times start at the first frame [s].

    `NAME.joints.csv` has the commanded positions, and `NAME.frames.csv` the frames. If the arm was
    measured, `NAME.measured.csv` has the measured values. If the arm followed a leader,
    `NAME.leader.csv` has the positions of the leader.

    Args:
        path: The recording.
        folder: Folder for the files. It is created if it does not exist.

    Returns:
        Paths of the written files.

    Raises:
        RecordingError: The recording cannot be read.
        OSError: The files cannot be written.
    """
    joints, frames = (folder / f"{path.stem}.{what}.csv" for what in ("joints", "frames"))
    sent = Recording(path).frames()
    folder.mkdir(parents=True, exist_ok=True)
    with joints.open("w", newline="") as one, frames.open("w", newline="") as two:
        positions, lines = csv.writer(one), csv.writer(two)
        lines.writerow(["time_s", "scheduled_s", "late_ms", "hold", "frame"])
        zero: float | None = None
        for frame in sent:
            if zero is None:
                zero = frame.time
                positions.writerow(["time_s", *(f"{name}_rad" for name in frame.joints)])
            positions.writerow([f"{frame.time - zero:.9f}", *map(repr, frame.positions)])
            lines.writerow(_line(frame, zero))
        if zero is None:
            positions.writerow(["time_s"])
    found = [joints, frames]
    for kind, what in ((Measured, "measured"), (LeaderState, "leader")):
        found += _export_measured(path, kind, folder / f"{path.stem}.{what}.csv", zero)
    return tuple(found)


def _export_measured(
    path: Path, kind: type[Measured | LeaderState], file: Path, zero: float | None
) -> Iterator[Path]:
    """Write all records of a type to a file. Yield the file, or nothing if there is no record."""
    records = (each for each in Recording(path).records(kind) if isinstance(each, kind))
    first = next(records, None)
    if first is None:
        return
    start = first.time if zero is None else zero
    with file.open("w", newline="") as opened:
        rows = csv.DictWriter(opened, ["time_s", *_measured(first)], extrasaction="ignore")
        rows.writeheader()
        for record in chain([first], records):
            rows.writerow({"time_s": f"{record.time - start:z.9f}", **_measured(record)})
    yield file


def _measured(record: Measured | LeaderState) -> dict[str, float]:
    """Return the values of a measurement, by name of the column."""
    if isinstance(record, LeaderState):
        values = {"rad": record.positions}
    else:
        values = {_SUFFIXES.get(name, name): getattr(record, name) for name in QUANTITIES}
    return {
        f"{joint}_{suffix}": value
        for suffix, row in values.items()
        for joint, value in zip(record.joints, row, strict=False)  # a row may be empty
    }


def _line(frame: Sent, zero: float) -> list[str]:
    if frame.scheduled is None:
        return [f"{frame.time - zero:.9f}", "", "", "yes", frame.text]
    late = 1e3 * (frame.time - frame.scheduled)
    due = f"{frame.scheduled - zero:.9f}"
    return [f"{frame.time - zero:.9f}", due, f"{late:.3f}", "no", frame.text]
