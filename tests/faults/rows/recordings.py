"""Recordings: files of other programs, disks that fail, and processes that are killed."""

import itertools
import json
import os
import resource
import shutil
import signal
import time

from logs.records.file_format import UNFINISHED
from tests.faults.means.small_disk import small_disk
from tests.faults.means.wrong_calls import WrongCalls
from tests.faults.process import until
from tests.faults.row import Scene, last_line, messages, row
from tests.support.recordings.alterations import records_of, rewritten
from tests.support.recordings.bombs import BOMBS
from tests.support.recordings.single_changes import single_changes

READERS = (
    *("log info {}", "log show {}", "log export {} -o out", "log robot {} -o out"),
    *("log diff {0} {0}", "log plot {} -o out.png"),
    *("replay {} --watch --at 0", "replay {} --on virtual"),
)


@row(
    "recording-bombs",
    "small recordings unpack to 0.3 GB, claim any length, are nested 100,000 deep, or have a hole"
    " of 1 TB; every command for recordings reads them, and a server has them in its folder",
    "the server starts, answers, and takes less than 300 MiB; every command ends with a code of its"
    " own, within 1 GiB of addresses",
    limit=5,
    unit="s",
    times=3,
)
def unpack(scene: Scene) -> None:
    folder = scene.folder / "recordings"
    folder.mkdir()
    for number, make in enumerate(BOMBS.values()):
        name = f"20260101T{number:06}.000Z-{scene.random.choice(['1', 'server'])}.mcap"
        (folder / name).write_bytes(make())
    hole = folder / "20260101T999999.000Z-1.mcap"
    hole.write_bytes(b"\x89MCAP0\r\n" + UNFINISHED.encode())
    os.truncate(hole, 1 << 40)
    server = scene.serve()
    scene.figure(time.monotonic() - server.started)
    for name in (path.name for path in scene.share(scene.recordings())):
        for part in ("", "/events", "/series", "/robot", "/nodes"):
            begin = time.monotonic()
            status, answer = server.request("GET", f"/api/recordings/{name}{part}")
            scene.figure(time.monotonic() - begin)
            known = status == 200 or (isinstance(answer, dict) and "code" in answer)
            scene.check(known and status != 500, f"{part} of {name}: {status}: {answer!r:.200}")
    scene.check(server.get("/api/recordings")["recordings"], "the page lists nothing")
    scene.check(server.memory() < 300, f"the server takes {server.memory():.0f} MiB")
    server.stop()
    server.signal(15)
    server.wait()
    commands = [["log", "ls"], ["replay", "recordings", "--verify"]]
    for words, bomb in scene.share(itertools.product(READERS, scene.recordings())):
        commands.append([each.format(bomb) for each in words.split()])
    # The last one: it replaces most of them.
    commands.append(["log", "recover", *map(str, scene.recordings())])
    scene.injections = len(commands)
    for command in commands:
        begin = time.monotonic()
        done = scene.armtree(*command, limits={resource.RLIMIT_AS: 1 << 30})
        scene.ended(done, 0, 3, 4, 10, 12, what=" ".join(command))
        for wrong in ("bug in armtree", "Traceback", "MemoryError"):
            scene.check(wrong not in done.text(), f"{command}: {last_line(done)}")
        scene.figure(time.monotonic() - begin)


@row(
    # tests/logs/writing damages every byte of a small journal, and cuts it anywhere. Here a command
    # verifies each file, which takes up to a second.
    "changed-recordings",
    "a recording is cut, a bit of it is flipped, or one part of it is changed or removed",
    "none holds: `replay --verify` ends with 12, and names each with its code",
    times=4,
)
def change(scene: Scene) -> None:
    run = scene.run("21")
    scene.ended(run, 0)
    (path,) = scene.recordings()
    scene.verified()
    whole, records = path.read_bytes(), records_of(path)
    changes = list(single_changes(records))
    folder = scene.folder / "changed"
    folder.mkdir()
    for number in range(6):
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
    notes = "configuration", "rosbag2"
    kept = [each for each in records if getattr(each, "name", "") not in notes]
    rewritten(folder / "no-notes.mcap", kept)
    verify = scene.armtree("replay", "changed", "--verify", "--json")
    scene.ended(verify, 12)
    found = [json.loads(line) for line in verify.output.read_text().splitlines()]
    scene.check(len(found) == len(list(folder.iterdir())), f"{len(found)} files were verified")
    for each in found:
        scene.check(not each["holds"], f"{each['path']} holds")
        scene.check(
            each["code"] in ("log.truncated", "log.unreadable", "replay.differs", "file.robot")
            or not all(verdict["holds"] for verdict in each["verdicts"]),
            f"{each['path']} ends with {each['code']}",
        )


@row(
    "slow-disk",
    "every write to the recording takes 0.1 to 0.6 s for some seconds of a motion",
    "frames wait, none is sent unrecorded; the task is done, and the log names the disk",
    times=4,
)
def slow_disk(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, "-21.mcap")
    run = scene.moving(board, task="21", frames=(1, 8), calls=calls)
    calls.start(f"delay {scene.random.randint(100, 600)}")
    time.sleep(scene.random.uniform(0.5, 3.0))  # noqa: TID251, so long the disk is slow
    calls.stop()
    scene.ended(run, 0)
    lines = [str(each) for each in run.events("log")]
    words = [line for line in lines if "waited" in line and "writes to the disk took" in line]
    scene.check(words, f"the log does not name the disk: {lines}")
    scene.verified()


@row(
    "stuck-disk",
    "a write to the recording does not return for some seconds, while goals are queued",
    "the goal ends `log.behind` after `--recording-timeout`, nothing is sent unrecorded; the arm"
    " stays active, and the next goal is done",
    limit=2000,
    unit="ms",
    times=3,
)
def stuck_disk(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, "-20.mcap")
    options = ["--activate", "--policy", "queue", "--recording-timeout", "1"]
    server = scene.serve(*options, board=board, environment=calls.environment)
    first = server.goal(20)
    count = scene.random.randint(1, 8)
    until("the arm moves", lambda: len(board.frames()) > count)
    second = server.goal(21)
    calls.start("delay 3000")
    begin = time.monotonic()
    result = server.result(first)
    scene.figure(1000 * (time.monotonic() - begin))
    calls.stop()
    scene.check(result["code"] == "log.behind", f"the goal ends {result['code']}")
    scene.check("writes to the disk took" in result["message"], result["message"])
    scene.check(server.state() == "active", f"the arm is {server.state()}")
    result = server.result(second)
    scene.check(result["code"] == "ok", f"the next goal ends {result['code']}: {result}")
    server.signal(signal.SIGTERM)
    scene.ended(server, 0)
    scene.verified()


@row(
    "deleted-folder",
    "the folder of recordings is deleted while the first of two tasks runs",
    "the run ends with exit status 10 and `log.incomplete`, and the second task does not begin",
    limit=2500,
    unit="ms",
    times=3,
    quick=1,
)
def deleted_folder(scene: Scene) -> None:
    board = scene.board()
    run = scene.run(scene.random.choice(["20", "21"]), "23", board=board)
    run.until_event("sent", scene.random.randint(1, 8))
    begin = time.monotonic()
    shutil.rmtree(scene.folder / "recordings")
    scene.ended(run, 10)
    scene.figure(1000 * (board.frames()[-1].time - begin))
    results = run.events("result")
    codes = [each["code"] for each in results]
    scene.check(codes == ["log.incomplete"], f"the goals end {codes}")
    scene.check("deleted" in results[0]["message"], results[0]["message"])
    scene.unrecorded = len(board.frames())


@row(
    "lost-sync",
    "fsync of the recording fails during a motion",
    "the arm stops, the goal ends `log.incomplete` with exit status 10; what is recorded holds",
    times=3,
)
def lost_sync(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, "-20.mcap", "sync")
    run = scene.moving(board, frames=(1, 8), calls=calls)
    calls.start("errno 5 once")
    scene.ended(run, 10)
    (result,) = run.events("result")
    scene.check(result["code"] == "log.incomplete", f"the goal ends {result['code']}")
    scene.check(run.events("sent")[-1]["hold"], "the last frame is not a hold")
    scene.verified()


@row(
    "full-disk",
    "the disk of the recordings fills up at a random moment of a motion",
    "the arm stops with a hold frame and the goal ends `log.disk_full` with exit status 10; the"
    " recording has every frame and the result, and verifies when there is space again",
    times=3,
)
def full_disk(scene: Scene) -> None:
    with small_disk(scene) as disk:
        board = scene.board()
        run = scene.moving(board, disk=disk)
        disk.fill()
        scene.ended(run, 10)
        (result,) = run.events("result")
        frames = board.frames()
        if disk.real:
            scene.check(result["code"] == "log.disk_full", str(result))
            scene.check("its end was still recorded" in result["message"], result["message"])
            scene.check(frames[-1].data == frames[-2].data, "the last frame is not a hold")
            refused = scene.run("21", board=board, argv=disk.argv)
            scene.ended(refused, 10, what="a run on the full disk")
            code = refused.events("result")[-1]["code"]
            scene.check(code == "log.no_space", f"a run on the full disk ends {code}")
            scene.check(len(board.frames()) == len(frames), "that run has moved the arm")
        else:
            scene.unrecorded = 2  # the frame whose recording failed, and the hold
            scene.check(result["code"] in ("log.disk_full", "log.incomplete"), str(result))
        disk.empty()
        paths = [f"recordings/{name}" for name in disk.names()]
        scene.ended(scene.armtree("log", "recover", *paths, argv=disk.argv), 0, 10)
    if disk.real:
        ends = [data for path in scene.recordings() for _, data in messages(path, "/result")]
        scene.check(any(b"log.disk_full" in data for data in ends), "no recording has the result")
        scene.verified()
    else:
        scene.verified(10)  # the writes that failed are missing


@row(
    "kill-9-slow-disk",
    "`kill -9` while every write to the recording takes 0.2 to 1 s",
    "at most the frame in flight is missing from the recording",
    times=4,
)
def kill_slow_disk(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, "-20.mcap")
    run = scene.moving(board, frames=(1, 8), calls=calls)
    calls.start(f"delay {scene.random.randint(200, 1000)}")
    until("a slow write", calls.calls)
    time.sleep(scene.random.uniform(0.0, 2.0))  # noqa: TID251, a random moment
    run.signal(signal.SIGKILL)
    status = run.wait()
    scene.check(status == -signal.SIGKILL, f"the run had ended with {status} before it was killed")
    scene.unrecorded = scene.unreceived = 1


@row(
    "kill-9-at-end",
    "`kill -9` while the recording is being finished",
    "the recording is whole or is recovered; it holds, and is never lost",
    times=6,
)
def kill_at_end(scene: Scene) -> None:
    board, status, runs = scene.board(), 0, 0
    while status != -signal.SIGKILL and runs < 10:  # else it had ended before
        runs += 1
        run = scene.run("21", board=board)
        run.until_event("sent", 10)
        run.until_printed("shuttingdown")
        time.sleep(scene.random.uniform(0.0, 0.1))  # noqa: TID251, a random moment
        run.signal(signal.SIGKILL)
        status = run.wait()
    scene.check(status == -signal.SIGKILL, "each run had ended before it was killed")
    left = len(scene.recordings())
    scene.check(left == runs, f"{left} of {runs} recordings are left")
    scene.recovered(0, 10)
    scene.verified(0, 10)
    scene.check(not list(scene.folder.glob("recordings/*.part")), "a partial copy is left")
