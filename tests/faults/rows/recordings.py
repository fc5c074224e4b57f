"""Recordings: files of other programs, disks that fail, and processes that are killed."""

import time

from tests.faults.row import Scene, last_line, row
from tests.support.recordings.bombs import bombs


@row(
    "recording-bombs",
    "small recordings that unpack to 0.3 GB, claim any length, or are nested 100,000 deep",
    "a server whose folder they are in starts; every command ends with a code of its own",
    limit=10,
    unit="s",
    times=3,
    quick=1,
)
def unpack(scene: Scene) -> None:
    folder = scene.folder / "recordings"
    folder.mkdir()
    for number, data in enumerate(bombs().values()):
        name = f"20260101T{number:06}.000Z-{scene.random.choice(['1', 'server'])}.mcap"
        (folder / name).write_bytes(data)
    server = scene.serve()
    scene.figure(time.monotonic() - server.started)
    scene.check(server.memory() < 300, f"the server takes {server.memory():.0f} MiB")
    server.stop()
    server.signal(15)
    server.wait()
    for command in (["log", "ls"], ["tasks"], ["replay", "recordings", "--verify"]):
        begin = time.monotonic()
        done = scene.armtree(*command)
        scene.check(done.wait() in (0, 3, 10, 12), f"{command}: {done.wait()}, {last_line(done)}")
        scene.check("a bug in armtree" not in done.text(), f"{command}: {last_line(done)}")
        scene.figure(time.monotonic() - begin)
