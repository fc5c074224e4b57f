"""The mesh files of a URDF. It names them by `package://` and relative paths."""

import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import unquote

from .urdf import UrdfError

MAX_MESH_BYTES = 2**26
_PACKAGE = "package://"


class MeshMissing(UrdfError):
    """A mesh file does not exist."""


def find_mesh(urdf: Path, name: str) -> Path:
    """Return the file of a mesh.

    `package://NAME/FILE` is searched in every folder above the URDF, as `NAME/FILE` and as `FILE`,
    then in the packages of `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`. A relative path begins at
    the folder of the URDF, or at one above it.

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
    """Yield the mistakes of meshes. All missing meshes of one package are one mistake.

    Args:
        urdf: The URDF file.
        names: Names of the files in the URDF.
    """
    missing = dict[str, list[str]]()
    for name in names:
        try:
            find_mesh(urdf, name)
        except MeshMissing:
            missing.setdefault(_package(name) or name, []).append(name)
        except UrdfError as error:
            yield error
    for package, (name, *others) in missing.items():
        what = f"the mesh {name} is"
        if others:
            what = f"{len(others) + 1} meshes of {_PACKAGE}{package}, such as {name}, are"
        yield MeshMissing(f"{what} not found; {_advice(urdf, name)}")


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
        for path in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
            yield Path(path) / package / file
        for path in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
            yield Path(path) / "share" / package / file


def _advice(urdf: Path, name: str) -> str:
    if package := _package(name):
        where = f"put the folder {package} beside {urdf.name} or above it"
        return f"{where}, or name the folder around it in ROS_PACKAGE_PATH"
    if "://" in name:
        return "armtree opens only package://, file:// and paths relative to the URDF"
    return f"copy it there, or correct its path in {urdf.name}"
