"""Recordings: files of other programs, disks that fail, and processes that are killed."""

import json
import time

from tests.faults.row import Scene, last_line, row
from tests.support.recordings.alterations import records_of, rewritten
from tests.support.recordings.bombs import bombs
from tests.support.recordings.single_changes import single_changes


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


@row(
    "changed-recordings",
    "a recording is cut, a bit of it is flipped, or one part of it is changed or removed",
    "none holds: `replay --verify` ends with 12, and names each with its code",
    times=4,
    quick=1,
)
def change(scene: Scene) -> None:
    run = scene.run("21")
    scene.check(run.wait() == 0, f"exit status {run.wait()}, not 0")
    (path,) = scene.recordings()
    scene.verified()
    whole, records = path.read_bytes(), records_of(path)
    changes = list(single_changes(records))
    folder = scene.folder / "changed"
    folder.mkdir()
    for number in range(12):
        cut, bit = scene.random.randrange(8, len(whole)), scene.random.randrange(len(whole) * 8)
        (folder / f"cut-at-{cut}.mcap").write_bytes(whole[:cut])
        flipped = bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        (folder / f"bit-{bit}.mcap").write_bytes(flipped)
        name, changed = scene.random.choice(changes)
        digests = scene.random.random() < 0.8
        words = "".join(each if each.isalnum() else "-" for each in name)[:80]
        rewritten(folder / f"{number}-{words}-{digests}.mcap", changed, digests)
    rewritten(folder / "no-digests.mcap", records)
    verify = scene.armtree("replay", "changed", "--verify", "--json")
    scene.check(verify.wait() == 12, f"exit status {verify.wait()}, not 12")
    found = [json.loads(line) for line in verify.output.read_text().splitlines()]
    scene.check(len(found) == len(list(folder.iterdir())), f"{len(found)} files were verified")
    for each in found:
        scene.check(not each["holds"], f"{each['path']} holds")
        scene.check(
            each["code"] in ("log.truncated", "log.unreadable", "replay.differs")
            or not all(verdict["holds"] for verdict in each["verdicts"]),
            f"{each['path']} ends with {each['code']}",
        )
