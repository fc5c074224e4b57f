"""The robot and the world of a run: saved in a recording as notes and files, and restored.

The attachments hold the robot's files and the meshes of bodies; notes hold values that are in no
file. A recording restores both without any file of the machine it was made on.
"""

import json
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from hardware import Robot, load_robot
from logs import Recording, RecordingError
from skills.motion import World

_NOTE = "robot"


def robot_note(robot: Robot) -> dict[str, str]:
    """Return which attachments describe the robot, and the firmware's values."""
    figures = {name: _plain(value) for name, value in asdict(robot.firmware).items()}
    return {
        "file": robot.path.name,
        "urdf": robot.urdf.name,
        "sha256": _digest(robot.path.read_bytes(), robot.urdf.read_bytes()),
        "firmware": json.dumps(figures),
    }


def restore_robot(recording: Recording) -> Robot:
    """Return the robot as it was recorded.

    Raises:
        RecordingError: The recording does not hold it.
        DescriptionError: The recorded description is invalid.
    """
    try:
        note = recording.notes[_NOTE]
        files = ((note[key], recording.files[note[key]]) for key in ("file", "urdf"))
        return _load(tuple(files), note["firmware"])
    except KeyError as missing:
        what = f"lacks {missing}, so its robot is unknown; another armtree recorded it"
        raise RecordingError(recording.path, what) from missing
    except (ValueError, RecursionError) as cause:
        what = f"holds an invalid firmware ({cause}); another program wrote it"
        raise RecordingError(recording.path, what) from cause


def robot_files_changed(recording: Recording) -> bool:
    """Return whether the attached robot files differ from those the run used."""
    note = recording.notes[_NOTE]
    return note.get("sha256") != _digest(*(recording.files[note[key]] for key in ("file", "urdf")))


@lru_cache(maxsize=8)
def archive_world(world: World) -> tuple[tuple[dict[str, Any], ...], Mapping[str, bytes]]:
    """Return a world as plain values, and its mesh files.

    Returns:
        The bodies, each mesh named by its content, and the content of each mesh by that name.
    """
    bodies, files = world.plain(), dict[str, bytes]()
    for body in bodies:
        mesh = body.get("mesh")
        if mesh and (path := Path(mesh["path"])).is_file():
            data = path.read_bytes()
            mesh["path"] = f"{sha256(data).hexdigest()[:12]}_{path.name}"
            files[mesh["path"]] = data
    return tuple(bodies), files


def restore_world(bodies: Iterable[Mapping[str, Any]], files: Mapping[str, bytes]) -> World:
    """Return a world as it was recorded.

    Args:
        bodies: The recorded bodies.
        files: Attachments of the recording, by name; they hold the meshes.

    Raises:
        BadWorld: The recorded world is invalid.
    """
    return World.parse(_with_mesh(body, files) for body in bodies)


def _with_mesh(body: Mapping[str, Any], files: Mapping[str, bytes]) -> Mapping[str, Any]:
    mesh = body.get("mesh")
    if not mesh or mesh["path"] not in files:
        return body
    path = Path(_restored_files().name) / Path(mesh["path"]).name
    path.write_bytes(files[mesh["path"]])
    return {**body, "mesh": {**mesh, "path": str(path)}}


@lru_cache(maxsize=8)
def _load(files: tuple[tuple[str, bytes], ...], firmware: str) -> Robot:
    folder = Path(_restored_files().name) / _digest(*(data for _, data in files))
    folder.mkdir(exist_ok=True)
    for name, data in files:
        (folder / Path(name).name).write_bytes(data)
    robot = load_robot(folder / Path(files[0][0]).name)
    return replace(robot, firmware=replace(robot.firmware, **_firmware_values(robot, firmware)))


def _firmware_values(robot: Robot, recorded: str) -> dict[str, Any]:
    """Return the recorded values of the firmware; values of a newer armtree are ignored.

    Raises:
        ValueError: A value has the wrong type.
    """
    figures: dict[str, Any] = asdict(robot.firmware)
    values = json.loads(recorded)
    if not isinstance(values, dict):
        raise ValueError("it is no JSON object")
    for name, known in figures.items():
        value = values.get(name, _plain(known))
        if not _same_type(value, _plain(known)):
            raise ValueError(f"{name} {value!r}")
        figures[name] = value.encode("latin-1") if isinstance(known, bytes) else value
    return figures


def _same_type(value: Any, known: Any) -> bool:
    return isinstance(value, (int, float) if isinstance(known, float) else type(known))


@cache
def _restored_files() -> "tempfile.TemporaryDirectory[str]":
    """Folder for restored files; it is deleted when this process ends."""
    return tempfile.TemporaryDirectory(prefix="armtree-")


def _plain(value: Any) -> Any:
    return value.decode("latin-1") if isinstance(value, bytes) else value


def _digest(*files: bytes) -> str:
    return sha256(b"".join(sha256(data).digest() for data in files)).hexdigest()
