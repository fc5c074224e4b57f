"""Builds armtree by setuptools, and keeps the names of its rooms out of the way of others.

The rooms are packages named `logs`, `skills` and so on. Beside other packages, they could overwrite
files of another package of such a name. In the wheel they are in the folder `armtree_rooms`, and
`armtree.pth` puts it at the end of `sys.path`: no file of others is touched, and `import logs`
still finds the package of another distribution first. armtree then ends with an error that says
what to do; see `armtree.py`. In an environment of its own, as `pipx` and `uv tool` make it,
all names are free.
"""

import base64
import gzip
import hashlib
import io
import os
import tarfile
import zipfile
from pathlib import Path

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403  the hooks of an editable install, and the others

ROOMS = ("executive", "hardware", "logs", "skills", "trees")
FOLDER = "armtree_rooms"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Build a wheel, and move the rooms in it into their folder."""
    name = build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)
    path = Path(wheel_directory) / name
    with zipfile.ZipFile(path) as built:
        files = {info: built.read(info) for info in built.infolist()}
    first = next(iter(files))
    pth = zipfile.ZipInfo("armtree.pth", first.date_time)
    pth.external_attr, pth.compress_type = first.external_attr, zipfile.ZIP_DEFLATED
    rows = []
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as moved:
        for info, data in {pth: f"{FOLDER}\n".encode(), **files}.items():
            if info.filename.endswith(".dist-info/RECORD"):
                record = info
                continue
            if info.filename.partition("/")[0] in ROOMS:
                info.filename = f"{FOLDER}/{info.filename}"
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            rows.append(f"{info.filename},sha256={digest},{len(data)}\n")
            moved.writestr(info, data)
        moved.writestr(record, "".join([*rows, f"{record.filename},,\n"]))
    return name


def build_sdist(sdist_directory, config_settings=None):
    """Build a source archive with this file, without which it builds nothing, and no tests.

    setuptools adds some files of `tests/`, which do not run without the others.
    """
    name = build_meta.build_sdist(sdist_directory, config_settings)
    path = Path(sdist_directory) / name
    with tarfile.open(path) as built:
        members = [(each, built.extractfile(each)) for each in built.getmembers()]
        here = tarfile.TarInfo(f"{name.removesuffix('.tar.gz')}/.ci/{Path(__file__).name}")
        here.size = Path(__file__).stat().st_size
        members.append((here, io.BytesIO(Path(__file__).read_bytes())))
        time = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))  # equal files give an equal archive
        whole = path.with_suffix(".new")
        with (
            whole.open("wb") as raw,
            gzip.GzipFile("", "wb", fileobj=raw, mtime=time) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as added,
        ):
            for member, data in sorted(members, key=lambda pair: pair[0].name):
                if member.name.split("/")[1:2] == ["tests"]:
                    continue
                member.mtime, member.pax_headers = time, {}
                added.addfile(member, data)
    whole.replace(path)
    return name
