"""A small file system for recordings, which can be filled."""

import contextlib
import errno
import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tests.faults.means.wrong_calls import WrongCalls
from tests.faults.process import ARMTREE

if TYPE_CHECKING:
    from tests.faults.row import Scene

FILLER = shutil.ignore_patterns("filler")
SIZE = "160m"  # a run begins only if 100 MB are free
# Mounts it in a namespace of its own, and keeps that until its input ends.
HOLD = f'mount -t tmpfs -o size={SIZE} tmpfs "$0" && echo mounted && exec cat'


class SmallDisk:
    """The file system under the folder of recordings.

    Args:
        folder: Where it is, as this process sees it.
        argv: How to start `armtree` so that it sees it.
        calls: What fails in its place, if there is none.
    """

    def __init__(
        self, folder: Path, argv: Sequence[str | Path] = (ARMTREE,), calls: WrongCalls | None = None
    ) -> None:
        self._folder, self._filler, self._calls = folder, folder / "filler", calls
        self.argv = argv
        self.real = calls is None
        self.environment: Mapping[str, str] | None = calls.environment if calls else None

    def names(self) -> list[str]:
        """The names of the recordings."""
        return sorted(path.name for path in self._folder.glob("*.mcap"))

    def fill(self) -> None:
        """Leave no space."""
        if self._calls:
            self._calls.start(f"errno {errno.ENOSPC}")
            return
        with self._filler.open("wb", 0) as filler, contextlib.suppress(OSError):
            free = os.statvfs(self._filler.parent)
            os.posix_fallocate(filler.fileno(), 0, free.f_bavail * free.f_frsize)
        with self._filler.open("ab", 0) as filler, contextlib.suppress(OSError):
            while True:  # what another program freed or took meanwhile
                filler.write(bytes(4096))

    def empty(self) -> None:
        """Make space again."""
        if self._calls:
            self._calls.stop()
        else:
            self._filler.unlink()


def unmount(folder: Path) -> None:
    """Unmount a folder, but keep its recordings, which are verified later."""
    kept = shutil.copytree(folder, folder.with_suffix(".kept"), ignore=FILLER)
    subprocess.run(["umount", str(folder)], check=True)
    folder.rmdir()
    kept.rename(folder)


@contextlib.contextmanager
def small_disk(scene: "Scene") -> Iterator[SmallDisk]:
    """A small file system for the recordings of a scene, made by the best means of the machine.

    Root mounts it. Other users mount it in a user namespace. Where that is forbidden, the writes of
    the command fail as on a full disk.
    """
    folder = scene.folder / "recordings"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode == 0:
        scene.by("a small file system")
        scene.cleanup.callback(unmount, folder)  # what was recorded is compared before
        yield SmallDisk(folder)
        return
    with subprocess.Popen(
        ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as holder:
        assert holder.stdout
        if holder.stdout.readline():
            scene.by("a small file system in a user namespace")
            enter = "nsenter", "-t", str(holder.pid), "--user", "--mount", "--preserve-credentials"
            # A working folder of before leads to what is below the mount.
            again = "sh", "-c", 'cd "$0" && exec "$@"', scene.folder
            there = Path(f"/proc/{holder.pid}/root{folder}")
            try:
                yield SmallDisk(there, (*enter, *again, ARMTREE))
            finally:
                shutil.copytree(there, folder, ignore=FILLER, dirs_exist_ok=True)
            return
    scene.by("writes that fail with ENOSPC, because no file system can be mounted")
    yield SmallDisk(folder, calls=WrongCalls(scene.folder, ".mcap"))
