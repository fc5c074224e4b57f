"""The robot and the world of a run: saved in a recording as notes and files, and restored.

Attachments have the robot's files and all meshes. Notes have values that are not in a file. A
recording restores both without other files.
"""

import json
import re
import tempfile
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hardware import DescriptionError, Robot, load_robot, read_file
from hardware.description.meshes import MAX_MESH_BYTES
from hardware.description.urdf import UrdfError
from hardware.loading.dataclass import dataclass
from logs import Attachment, FileKept, RecordingError, pack
from skills.motion import World

if TYPE_CHECKING:
    from logs import Recording

_NOTE = "robot"
_making = threading.Lock()  # else two threads could make two folders, despite the cache
MAX_MESHES = 2**26  # largest total size of the meshes of a robot in a recording [bytes]
_MAX_RATE = 1000.0  # largest rate [Hz]; a motion of ten minutes then has 600,000 frames


@dataclass(frozen=True, slots=True)
class RobotMeshes:
    """The meshes of a robot, for a recording.

    Attributes:
        names: Name of the attachment by the name in the URDF.
        files: Attachments by name. The meshes that only a viewer needs are left out if they would
            exceed `MAX_MESHES`.
        left_out: Why the meshes of collision shapes are left out; empty if they are attached.
    """

    names: Mapping[str, str]
    files: Mapping[str, Attachment]
    left_out: str = ""


def archive_meshes(robot: Robot) -> RobotMeshes:
    """Return the meshes in the URDF of a robot, each once. Missing meshes are left out."""
    names, files, size = dict[str, str](), dict[str, Attachment](), 0
    for name, collides in robot.description.meshes().items():
        with suppress(UrdfError, OSError):  # the planner reports the error
            path = robot.mesh(name)
            data = read_file(path, MAX_MESH_BYTES)
            attached = _mesh_name(path, data)
            new = 0 if attached in files else len(data)
            if size + new > MAX_MESHES and collides:
                return RobotMeshes({}, {}, _too_large(robot))
            if size + new <= MAX_MESHES:
                names[name], size = attached, size + new
                files[attached] = files.get(attached) or pack(attached, data)
    return RobotMeshes(names, files)


def _too_large(robot: Robot) -> str:
    words = f"the meshes of {robot.urdf.name} are not attached, because they have more than "
    return f"{words}{MAX_MESHES >> 20} MiB; `replay --verify` needs meshes with fewer triangles"


def _mesh_name(path: Path, data: bytes) -> str:
    return f"{sha256(data).hexdigest()[:12]}_{path.name}"


def robot_note(robot: Robot, files: Mapping[str, bytes], meshes: RobotMeshes) -> dict[str, str]:
    """Return the note that names the robot's attachments and the firmware's values.

    Args:
        robot: The robot.
        files: Contents of the robot's files, by name.
        meshes: The robot's meshes.
    """
    figures = {name: _plain(value) for name, value in _figures(robot).items()}
    named = {"calibration": robot.calibration.name} if robot.calibration else {}
    return named | {
        "file": robot.path.name,
        "urdf": robot.urdf.name,
        "sha256": _digest(*files.values()),
        "firmware": json.dumps(figures),
        "meshes": json.dumps(dict(meshes.names)),
        "meshes_left_out": meshes.left_out,
    }


def restore_robot(recording: "Recording") -> Robot:
    """Return the recorded robot.

    Raises:
        RecordingError: The recording does not contain the robot, or its files are invalid.
    """
    try:
        note = recording.notes[_NOTE]
        if left_out := note.get("meshes_left_out"):
            raise RecordingError(recording.path, f"cannot be verified: {left_out}")
        files = tuple((name, recording.files[name]) for name in _robot_files(note))
        paths = {
            name: _restored_mesh(file, recording.files)
            for name, file in _attached_meshes(recording).items()
        }
        return _load(files, note["firmware"], tuple((n, p) for n, p in paths.items() if p))
    except KeyError as missing:
        what = f"lacks {missing}, so its robot is unknown; another version of armtree recorded it"
        raise RecordingError(recording.path, what) from missing
    except DescriptionError as cause:
        what = f"holds a robot that this version of armtree cannot read: {in_recording(str(cause))}"
        raise RecordingError(recording.path, what) from cause
    except (ValueError, RecursionError) as cause:
        what = f"holds an invalid robot ({cause}); another program wrote it"
        raise RecordingError(recording.path, what) from cause


def in_recording(message: str) -> str:
    """Return a message with names of attachments in place of the paths of restored files."""
    return re.sub(rf"{re.escape(str(_restored_files()))}/([0-9a-f]{{64}}/)?", "", message)


def extract_robot(recording: "Recording", folder: Path) -> list[Path]:
    """Write the robot file, URDF and meshes of a recording to a folder. Return the files.

    The URDF refers to the meshes in this folder, so viewers find them. If the folder already has a
    file with one of these names and another content, nothing is written.

    Raises:
        RecordingError: The recording does not contain the robot.
        FileKept: A file exists with another content.
        OSError: A file cannot be written.
    """
    robot, meshes = restore_robot(recording), _attached_meshes(recording)
    text = robot.path.read_text()
    text = re.sub(r"(?m)^urdf\s*=.*$", lambda _: f"urdf = {json.dumps(robot.urdf.name)}", text)
    kinds = ("collision", "visual")
    urdf = robot.description.text_with_meshes(lambda name: meshes.get(name, name), kinds)
    contents = {robot.path.name: text.encode(), robot.urdf.name: urdf.encode()}
    if robot.calibration:
        contents[robot.calibration.name] = robot.calibration.read_bytes()
    for name in sorted(set(meshes.values()) & recording.files.keys()):
        contents[name] = recording.files[name]
    files = {folder / name: content for name, content in contents.items()}
    for path, content in files.items():
        if path.exists() and (not path.is_file() or path.read_bytes() != content):
            raise FileKept(path)
    folder.mkdir(parents=True, exist_ok=True)
    for path, content in files.items():
        path.write_bytes(content)
    return list(files)


def _attached_meshes(recording: "Recording") -> dict[str, str]:
    """Return the name of the attachment of each mesh, by its name in the URDF.

    Raises:
        ValueError: The note about the robot is invalid.
    """
    values = json.loads(recording.notes[_NOTE].get("meshes", "{}"))
    if not isinstance(values, dict) or any(Path(str(v)).name != v for v in values.values()):
        raise ValueError("its meshes are not names of attachments")
    return values


def robot_files_changed(recording: "Recording") -> bool:
    """Return True if the attached robot files differ from the files of the run."""
    note = recording.notes[_NOTE]
    return note.get("sha256") != _digest(*(recording.files[name] for name in _robot_files(note)))


def _robot_files(note: Mapping[str, str]) -> list[str]:
    """Return the names of the robot file, the URDF and, if there is one, the calibration."""
    return [note["file"], note["urdf"], *filter(None, [note.get("calibration")])]


def _figures(robot: Robot) -> dict[str, Any]:
    """Return the values of the firmware that may differ between versions of armtree."""
    figures = asdict(robot.firmware)
    del figures["abilities"], figures["bauds"], figures["words"]
    return figures


@lru_cache(maxsize=8)
def archive_world(world: World) -> tuple[tuple[dict[str, Any], ...], Mapping[str, Attachment]]:
    """Return a world as plain values, and its mesh files.

    Returns:
        The bodies, each with a name made from the content of its mesh in place of the path; and the
        attachments of the meshes, by this name.
    """
    bodies, files = world.plain(), dict[str, Attachment]()
    for body in bodies:
        mesh = body.get("mesh")
        if mesh and (path := Path(mesh["path"])).is_file():
            data = path.read_bytes()
            mesh["path"] = _mesh_name(path, data)
            files[mesh["path"]] = pack(mesh["path"], data)
    return tuple(bodies), files


def restore_world(bodies: Iterable[Mapping[str, Any]], files: Mapping[str, bytes]) -> World:
    """Return a recorded world.

    Args:
        bodies: The recorded bodies.
        files: Attachments of the recording with the meshes, by name.

    Raises:
        BadWorld: The recorded world is invalid.
    """
    return World.parse(_with_mesh(body, files) for body in bodies)


def _with_mesh(body: Mapping[str, Any], files: Mapping[str, bytes]) -> Mapping[str, Any]:
    mesh = body.get("mesh")
    path = _restored_mesh(mesh["path"], files) if mesh else None
    return {**body, "mesh": {**mesh, "path": str(path)}} if mesh and path else body


def _restored_mesh(name: str, files: Mapping[str, bytes]) -> Path | None:
    """Return a file with the content of an attachment, or None if there is no such attachment."""
    if name not in files:
        return None
    path = _restored_files() / Path(name).name
    _write(path, files[name])
    return path


def _write(path: Path, data: bytes) -> None:
    """Write a file atomically, because other threads may restore or read it at the same time."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as part:
        part.write(data)
    Path(part.name).replace(path)


@lru_cache(maxsize=8)
def _load(
    files: tuple[tuple[str, bytes], ...], firmware: str, meshes: tuple[tuple[str, Path], ...]
) -> Robot:
    named = (str(path).encode() for _, path in meshes)  # the name contains a digest
    folder = _restored_files() / _digest(*(data for _, data in files), *named)
    folder.mkdir(exist_ok=True)
    for name, data in files:
        _write(folder / Path(name).name, data)
    file, urdf = (folder / Path(name).name for name, _ in files[:2])
    robot = load_robot(file, urdf)
    robot = replace(robot, meshes=dict(meshes))
    return replace(robot, firmware=replace(robot.firmware, **_firmware_values(robot, firmware)))


def _firmware_values(robot: Robot, recorded: str) -> dict[str, Any]:
    """Return the recorded values of the firmware. Values of a newer armtree are ignored.

    Raises:
        ValueError: A value has the wrong type, or is out of range.
    """
    figures = _figures(robot)
    values = json.loads(recorded)
    if not isinstance(values, dict):
        raise ValueError("it is not a JSON object")
    for name, known in figures.items():
        value = values.get(name, _plain(known))
        if not _same_type(value, _plain(known)) or not _in_range(name, value):
            raise ValueError(f"{name} is {value!r}: wrong type or out of range")
        figures[name] = value.encode("latin-1") if isinstance(known, bytes) else value
    return figures


def _same_type(value: Any, known: Any) -> bool:
    return isinstance(value, (int, float) if isinstance(known, float) else type(known))


def _in_range(name: str, value: Any) -> bool:
    """Return True if a value is a text, or a number in a safe range."""
    if isinstance(value, str):
        return True
    return 0 < value <= _MAX_RATE if name == "rate" else bool(value >= 0)


def _restored_files() -> Path:
    """Return the folder for restored files. It is deleted at the end of this process."""
    with _making:
        return Path(_folder().name)


@cache
def _folder() -> "tempfile.TemporaryDirectory[str]":
    return tempfile.TemporaryDirectory(prefix="armtree-")


def _plain(value: Any) -> Any:
    return value.decode("latin-1") if isinstance(value, bytes) else value


def _digest(*files: bytes) -> str:
    return sha256(b"".join(sha256(data).digest() for data in files)).hexdigest()
