"""The mesh files of a URDF, which names them by `package://` and relative paths."""

import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from operator import mul
from pathlib import Path
from struct import unpack_from
from urllib.parse import unquote

from .urdf import Urdf, UrdfError

MAX_MESH_BYTES = 2**26
MAX_SIZE = 20.0  # largest plausible size or distance along an axis; more looks like mm [m]
_TRIANGLES = 1000  # number of triangles that are measured of a large mesh, about
_PACKAGE = "package://"


class MeshMissing(UrdfError):
    """A mesh file does not exist."""


def find_mesh(urdf: Path, name: str) -> Path:
    """Return the file of a mesh.

    `package://NAME/FILE` is searched in every folder above the URDF, as `NAME/FILE` and as `FILE`,
    then in the packages of `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`. A relative path begins at
    the folder of the URDF, or at a folder above.

    Args:
        urdf: The URDF file.
        name: Name of the file in the URDF.

    Raises:
        MeshMissing: There is no such file.
        UrdfError: The path is not an ordinary file, or the file is larger than 64 MiB.
    """
    for path in _candidates(urdf, name):
        try:
            found = os.stat(path)
        except (OSError, ValueError):  # the file does not exist, or the path is invalid
            continue
        if stat.S_ISDIR(found.st_mode):
            continue
        if not stat.S_ISREG(found.st_mode):
            raise UrdfError(f"the mesh {path} is not an ordinary file; give STL, DAE or OBJ")
        if found.st_size > MAX_MESH_BYTES:
            size, most = (f"{size / 2**20:.1f} MiB" for size in (found.st_size, MAX_MESH_BYTES))
            raise UrdfError(f"the mesh {path} has {size}; give one with at most {most}")
        return path
    raise MeshMissing(f"the mesh {name} is not found; {_advice(urdf, name)}")


def mesh_mistakes(urdf: Path, names: Iterable[str]) -> Iterator[UrdfError]:
    """Yield the mistakes of meshes. The missing meshes of one package share a mistake.

    The content of a file is not checked, except for the structure of STL files.

    Args:
        urdf: The URDF file.
        names: Names of the files in the URDF.
    """
    missing = dict[str, list[str]]()
    for name in names:
        try:
            path = find_mesh(urdf, name)
            if path.suffix.lower() == ".stl" and not _is_stl(path):
                yield UrdfError(f"the mesh {path} is not STL, or is cut off; export it again")
        except MeshMissing:
            missing.setdefault(_package(name) or name, []).append(name)
        except OSError as error:
            yield UrdfError(f"the mesh {path} cannot be read: {error.strerror}")
        except UrdfError as error:
            yield error
    for package, lost in missing.items():
        what = f"the mesh {lost[0]} is not found"
        if len(lost) > 1:
            what = f"{len(lost)} meshes of {_PACKAGE}{package}, such as {lost[0]}, are not found"
            if _package_folder(urdf, package):
                files = ", ".join(name.removeprefix(f"{_PACKAGE}{package}/") for name in lost)
                what = f"{len(lost)} meshes of {_PACKAGE}{package} are not found: {files}"
        yield MeshMissing(f"{what}; {_advice(urdf, *lost)}")


def mesh_size_mistakes(path: Path, urdf: Urdf) -> Iterator[UrdfError]:
    """Yield a mistake for each collision mesh in mm.

    Only binary STL files are checked, by some of their triangles.

    Args:
        path: The URDF file.
        urdf: The URDF.
    """
    reported = set[str]()
    for line, name, scale in urdf.mesh_scales():
        try:
            file = find_mesh(path, name)
            size = max(map(mul, _stl_size(file), map(abs, scale)), default=0.0)
        except (UrdfError, OSError):  # `mesh_mistakes` reports them
            continue
        if size > MAX_SIZE and name not in reported:
            reported.add(name)
            yield UrdfError(mesh_in_mm(file.name, size, scale), line)


def mesh_in_mm(name: str, size: float, scale: Sequence[float]) -> str:
    """Return the message for a mesh that looks like mm.

    Args:
        name: Name of the file.
        size: Largest size of the mesh along an axis [m].
        scale: Scale of the mesh in the URDF along x, y and z.
    """
    right = " ".join(f"{each / 1e3:g}" for each in scale)
    why = f"the mesh {name} is {size:.0f} m long, which looks like mm"
    return f'{why}; write scale="{right}" in its <mesh>'


def _stl_size(path: Path) -> Sequence[float]:
    """Return a lower bound of the size of a binary STL along x, y and z; empty for other files."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if not count or len(data) != 84 + 50 * count:
        return ()
    corners = list[tuple[float, ...]]()
    for k in range(0, count, max(1, count // _TRIANGLES)):
        nine = unpack_from("<9f", data, 84 + 50 * k + 12)
        corners += nine[:3], nine[3:6], nine[6:]
    return [max(axis) - min(axis) for axis in zip(*corners, strict=True)]


def visual_mesh_warnings(path: Path, urdf: Urdf) -> Iterator[UrdfError]:
    """Yield the mistakes of meshes that no collision shape uses.

    Args:
        path: The URDF file.
        urdf: The URDF.
    """
    seen = [name for name, collides in urdf.meshes().items() if name and not collides]
    for each in mesh_mistakes(path, seen):
        yield UrdfError(f"{each}. Only viewers need visual meshes")


def _is_stl(path: Path) -> bool:
    """Return True if a file begins as a text STL, or has the right size for a binary STL."""
    with path.open("rb") as stream:
        head = stream.read(84)
    size = 84 + 50 * int.from_bytes(head[80:], "little")
    return head.lstrip().startswith(b"solid") or path.stat().st_size == size


def _package(name: str) -> str:
    """Return the package of a mesh; empty if its name has no package."""
    return name.removeprefix(_PACKAGE).partition("/")[0] if name.startswith(_PACKAGE) else ""


def _candidates(urdf: Path, name: str) -> Iterator[Path]:
    folders = urdf.absolute().parents
    scheme, separator, rest = name.partition("://")
    if not separator:
        yield from (folder / name for folder in folders)  # an absolute path replaces the folder
    elif scheme == "file":
        yield Path(unquote(rest))
    elif scheme == "package":
        package, _, file = rest.partition("/")
        yield from (folder / package / file for folder in folders)
        if file:
            yield from (folder / file for folder in folders)
        yield from (folder / file for folder in _ros_folders(package))


def _ros_folders(package: str) -> Iterator[Path]:
    for path in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield Path(path) / package
    for path in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(path) / "share" / package


def _package_folder(urdf: Path, package: str) -> Path | None:
    """Return the folder of a package, or None if it is not found."""
    near = (folder / package for folder in urdf.absolute().parents)
    return next((each for each in (*near, *_ros_folders(package)) if each.is_dir()), None)


def _advice(urdf: Path, name: str, *others: str) -> str:
    them, paths = ("them", "their paths") if others else ("it", "its path")
    if package := _package(name):
        if folder := _package_folder(urdf, package):
            return f"copy {them} into {folder}, or correct {paths} in {urdf.name}"
        where = f"put the folder {package} in the folder of {urdf.name} or a folder above"
        return f"{where}, or add the folder that contains {package} to ROS_PACKAGE_PATH"
    if "://" in name:
        return "armtree opens only package://, file:// and paths relative to the URDF"
    return f"copy the file to that path, or correct the path in {urdf.name}"
