"""What is noted of the robot and of how it is run; and a recorded robot, as it is had again."""

import json
import tempfile
from dataclasses import asdict, replace
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from hardware import Robot, load_robot
from logs import Recording, RecordingError

_NOTE = "robot"


def robot_note(robot: Robot) -> dict[str, str]:
    """Which of the attached files describe the robot, and the figures that no file holds."""
    figures = {name: _plain(value) for name, value in asdict(robot.firmware).items()}
    return {
        "file": robot.path.name,
        "urdf": robot.urdf.name,
        "sha256": _digest(robot.path.read_bytes(), robot.urdf.read_bytes()),
        "firmware": json.dumps(figures),
    }


def configuration_note(
    port: str, seed: int, timeout: float, policy: str, solo: bool
) -> dict[str, str]:
    """What else decides about a run; of the executive's arguments those that are values."""
    return {
        "port": port,
        "seed": str(seed),
        "planning_timeout_s": str(timeout),
        "policy": policy,
        "solo": str(solo),
    }


def robot_of(recording: Recording) -> Robot:
    """The robot as it was recorded.

    Raises:
        RecordingError: The recording does not hold it.
        DescriptionError: It holds one that makes no sense.
    """
    try:
        note = recording.notes[_NOTE]
        files = ((note[key], recording.files[note[key]]) for key in ("file", "urdf"))
        return _load(tuple(files), note["firmware"])
    except KeyError as missing:
        what = f"lacks {missing}, so that its robot is unknown; it was recorded by another armtree"
        raise RecordingError(recording.path, what) from missing
    except ValueError as cause:
        what = f"tells of a firmware that makes no sense ({cause}); another program wrote it"
        raise RecordingError(recording.path, what) from cause


def changed_since(recording: Recording) -> bool:
    """Whether the robot's files in a recording are others than those it was made with."""
    note = recording.notes[_NOTE]
    return note["sha256"] != _digest(*(recording.files[note[key]] for key in ("file", "urdf")))


@lru_cache(maxsize=8)
def _load(files: tuple[tuple[str, bytes], ...], firmware: str) -> Robot:
    folder = Path(scratch().name) / _digest(*(data for _, data in files))
    folder.mkdir(exist_ok=True)
    for name, data in files:
        (folder / Path(name).name).write_bytes(data)
    robot = load_robot(folder / Path(files[0][0]).name)
    return replace(robot, firmware=replace(robot.firmware, **_figures(robot, firmware)))


def _figures(robot: Robot, firmware: str) -> dict[str, Any]:
    """The firmware's figures; those of a newer armtree are left out.

    Raises:
        ValueError: One of them is of another kind.
    """
    figures: dict[str, Any] = asdict(robot.firmware)
    told = json.loads(firmware)
    for name, known in figures.items():
        value = told.get(name, _plain(known))
        if not _alike(value, _plain(known)):
            raise ValueError(f"{name} {value!r}")
        figures[name] = value.encode("latin-1") if isinstance(known, bytes) else value
    return figures


def _alike(value: Any, known: Any) -> bool:
    return isinstance(value, (int, float) if isinstance(known, float) else type(known))


@cache
def scratch() -> "tempfile.TemporaryDirectory[str]":
    """Where files of recordings lie while they are in use; gone when this process ends."""
    return tempfile.TemporaryDirectory(prefix="armtree-")


def _plain(value: Any) -> Any:
    return value.decode("latin-1") if isinstance(value, bytes) else value


def _digest(*files: bytes) -> str:
    return sha256(b"".join(sha256(data).digest() for data in files)).hexdigest()
