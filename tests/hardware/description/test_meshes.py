"""Where the mesh files of a URDF are found."""

import os
from pathlib import Path

import pytest

from hardware.description.meshes import MAX_MESH_BYTES, find_mesh, mesh_mistakes
from hardware.description.urdf import UrdfError

FOUND = {
    "beside": ("a/b/m.stl", "m.stl"),
    "in a folder": ("a/b/meshes/m.stl", "meshes/m.stl"),
    "above": ("a/meshes/m.stl", "../meshes/m.stl"),
    "from the package's root": ("a/meshes/m.stl", "meshes/m.stl"),
    "a package above": ("pack/meshes/m.stl", "package://pack/meshes/m.stl"),
    "a package of another folder's name": ("a/meshes/m.stl", "package://pack/meshes/m.stl"),
    "a package of ROS": ("ros/share/pack/m.stl", "package://pack/m.stl"),
    "a package of ROS 1": ("ros/src/pack/m.stl", "package://pack/m.stl"),
    "a URL": ("my%20folder/m.stl", "file://{root}/my%2520folder/m.stl"),
    "an absolute path": ("c/m.stl", "{root}/c/m.stl"),
}


@pytest.fixture
def urdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'ros'}")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'ros' / 'src'}:")
    (tmp_path / "a" / "b").mkdir(parents=True)
    return tmp_path / "a" / "b" / "arm.urdf"


@pytest.mark.parametrize(("file", "name"), FOUND.values(), ids=FOUND)
def test_a_mesh_is_found(urdf: Path, tmp_path: Path, file: str, name: str) -> None:
    path = tmp_path / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"mesh")
    assert find_mesh(urdf, name.format(root=tmp_path)).read_bytes() == b"mesh"


MISSING = {
    "package://pack/m.stl": "put the folder pack in the folder of arm.urdf or a folder above",
    "meshes/m.stl": r"copy the file to that path, or correct the path in arm\.urdf",
    "http://example.org/m.stl": "opens only package://, file://",
    "a\0b.stl": "is not found",
    "package://": "is not found",
    "": "is not found",
}


@pytest.mark.parametrize(("name", "why"), MISSING.items())
def test_a_mesh_that_is_missing_is_reported_with_what_to_do(
    urdf: Path, name: str, why: str
) -> None:
    with pytest.raises(UrdfError, match=why):
        find_mesh(urdf, name)


def test_the_missing_meshes_of_a_package_are_one_mistake(urdf: Path) -> None:
    names = [f"package://{name}" for name in ("p/a.stl", "q/b.stl", "p/c.stl", "p/d.stl")]
    found = [str(each).partition(";")[0] for each in mesh_mistakes(urdf, [*names, "e.stl"])]
    assert found == [
        "3 meshes of package://p, such as package://p/a.stl, are not found",
        "the mesh package://q/b.stl is not found",
        "the mesh e.stl is not found",
    ]


def test_every_file_that_a_package_lacks_is_named_with_its_folder(urdf: Path) -> None:
    folder = urdf.with_name("pack")
    folder.mkdir()
    names = ["package://pack/a.stl", "package://pack/gone/b.stl"]
    (both,) = map(str, mesh_mistakes(urdf, names))
    assert both == (
        "2 meshes of package://pack are not found: a.stl, gone/b.stl; "
        f"copy them into {folder}, or correct their paths in arm.urdf"
    )
    (one,) = map(str, mesh_mistakes(urdf, names[:1]))
    assert one.endswith(
        f"a.stl is not found; copy it into {folder}, or correct its path in arm.urdf"
    )


def test_a_file_that_is_no_stl_is_a_mistake(urdf: Path) -> None:
    files = {
        "text.stl": b"\n solid x\nendsolid",
        "binary.STL": bytes(80) + b"\2\0\0\0" + bytes(100),
        "garbage.stl": b"garbage" * 20,
        "cut.stl": bytes(80) + b"\2\0\0\0" + bytes(99),
        "empty.stl": b"",
        "other.obj": b"garbage",
    }
    for name, data in files.items():
        urdf.with_name(name).write_bytes(data)
    found = [str(each) for each in mesh_mistakes(urdf, files)]
    assert found == [
        f"the mesh {urdf.with_name(name)} is not STL, or is cut off; export it again"
        for name in ("garbage.stl", "cut.stl", "empty.stl")
    ]


def test_a_mesh_is_an_ordinary_file_of_bounded_size(urdf: Path) -> None:
    os.mkfifo(urdf.with_name("pipe.stl"))
    with pytest.raises(UrdfError, match=r"pipe\.stl is not an ordinary file"):
        find_mesh(urdf, "pipe.stl")
    os.truncate(os.open(urdf.with_name("big.stl"), os.O_CREAT | os.O_WRONLY), MAX_MESH_BYTES + 1)
    with pytest.raises(UrdfError, match=r"big\.stl has 64\.0 MiB; give one with at most 64\.0"):
        find_mesh(urdf, "big.stl")
