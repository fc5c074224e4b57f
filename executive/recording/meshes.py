"""The mesh files of a world: kept in a recording, and laid out again to plan from it."""

from collections.abc import Iterable, Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from skills.motion import World

from .evidence import scratch


@lru_cache(maxsize=8)
def kept(world: World) -> tuple[tuple[dict[str, Any], ...], Mapping[str, bytes]]:
    """A world as plain values that name each mesh by its content, and those files by that name."""
    bodies, files = world.plain(), dict[str, bytes]()
    for body in bodies:
        mesh = body.get("mesh")
        if mesh and (path := Path(mesh["path"])).is_file():
            data = path.read_bytes()
            mesh["path"] = f"{sha256(data).hexdigest()[:12]}_{path.name}"
            files[mesh["path"]] = data
    return tuple(bodies), files


def world_of(bodies: Iterable[Mapping[str, Any]], files: Mapping[str, bytes]) -> World:
    """The world that was recorded, its meshes among the files of the recording.

    Raises:
        BadWorld: It makes no sense.
    """
    return World.parse(_with_paths(body, files) for body in bodies)


def _with_paths(body: Mapping[str, Any], files: Mapping[str, bytes]) -> Mapping[str, Any]:
    mesh = body.get("mesh")
    if not mesh or mesh["path"] not in files:
        return body
    path = Path(scratch().name) / Path(mesh["path"]).name
    path.write_bytes(files[mesh["path"]])
    return {**body, "mesh": {**mesh, "path": str(path)}}
