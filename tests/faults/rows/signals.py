"""Signals, and the end of the process that started the command."""

import itertools
import math
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from tests.faults.board import Board, OwnFirmware, Read, Sketch
from tests.faults.means.wrong_calls import WrongCalls
from tests.faults.process import ARMTREE, kill, until
from tests.faults.row import Row, Scene, frames_of, row
from tests.faults.rows.planning import robot_of, world_of
from tests.support.recordings.bombs import BOMBS


@row(
    "signals",
    "SIGINT, SIGTERM or SIGHUP during a motion, once, or twice within 10 ms",
    "the arm is stopped with a hold frame, the recording finished; exit status 7",
    limit=300,
    unit="ms",
    times=6,
    quick=1,
)
def signals(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board)
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    ((which, twice),) = scene.share(itertools.product(numbers, (False, True)))
    sent = run.signal(which)
    if twice:  # as GNU `timeout` does: to the process, and to its group
        time.sleep(scene.random.uniform(0.0, 0.01))  # noqa: TID251, a random moment
        run.signal(which)
    scene.ended(run, 7, what=f"{which.name}{' twice' if twice else ''}")
    hold = run.events("sent")[-1]
    scene.check(hold["hold"], f"{which.name}: the last frame is not a hold")
    scene.figure(1000 * (hold["time_s"] - sent))
    scene.verified()


def recordings_of(scene: Scene) -> list[str | Path]:
    """A folder of recordings that unpack to 0.3 GB each."""
    folder, bomb = scene.folder / "huge", BOMBS["empty messages"]()
    folder.mkdir()
    for number in range(100):
        (folder / f"{number}.mcap").write_bytes(bomb)
    return [folder]


# Commands that read large files for a second or longer, and what makes the files.
READS: dict[str, tuple[tuple[str, ...], Callable[[Scene], list[str | Path]]]] = {
    "900 bodies": (("plan", "joint_1=0.5"), partial(world_of, count=900)),
    "900 links": (("plan", "joint_1=0.5"), partial(robot_of, count=900)),
    "recordings": (("replay", "--verify"), recordings_of),
}


@row(
    "signals-early",
    "SIGINT, SIGTERM or SIGHUP at a random time from the start of the command to its first motion,"
    " or while it reads a URDF of 900 links, a file of 900 obstacles or large recordings",
    "it ends, with exit status 7 or that of the signal, or by the signal itself, without a"
    " traceback; in the first 0.1 s Python is starting, and at Ctrl-C prints its own",
    limit=3,
    unit="s",
    times=12,
)
def signals_early(scene: Scene) -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    ((which, read),) = scene.share(itertools.product(numbers, ("", *READS)))
    if read:
        words, files = READS[read]
        run = scene.armtree(*words, *files(scene))
    else:
        run = scene.run("20", board=scene.board())
    time.sleep(scene.random.uniform(0.0, 0.8 if read else 3.0))  # noqa: TID251, a random moment
    what = f"{which.name}, {read or 'a run'}"
    scene.check(run.popen.poll() is None, f"{what}: it had ended before")
    sent = run.signal(which)
    run.wait()
    if not (which is signal.SIGINT and run.interrupted_python()):
        scene.ended(run, 7, 128 + which, -which, what=what)
    scene.figure(time.monotonic() - sent)
    until("the end of its processes", lambda: not run.family())


TRAVEL = 32  # of all servos [deg]
TRIES = 5

# Starts a command, on a terminal of which this program is the session's leader or without one, and
# writes its process id to a file. Then it waits; what it leaves when it is killed is the command.
PARENT = """
import os, pathlib, pty, subprocess, sys, time
file, kind, *command = sys.argv[1:]
if kind == "terminal":
    pid, master = pty.fork()
    if pid:  # keeps the terminal open until all have left it
        pathlib.Path(file + ".parent").write_text(str(pid))
        try:
            while True:
                os.read(master, 65536)
        except OSError:
            sys.exit()
child = subprocess.Popen(command)
if kind == "none":
    pathlib.Path(file + ".parent").write_text(str(os.getpid()))
pathlib.Path(file + ".tmp").write_text(str(child.pid))
os.rename(file + ".tmp", file)
child.wait()
"""


@row(
    "parent-dies",
    "`kill -9` of the process that started a run: the shell of its terminal, or a program without"
    " a terminal",
    "if its terminal has lost its shell, the arm is stopped with a hold frame; without a terminal"
    " the run continues, as with `nohup`, and stops at SIGTERM; the recording is finished",
    limit=300,
    unit="ms",
    times=4,
)
def parent_dies(scene: Scene) -> None:
    board, pid = scene.board(), scene.folder / "child.pid"
    (kind,) = scene.share(["terminal", "none"])
    argv = (sys.executable, "-c", PARENT, pid, kind, ARMTREE)
    run = scene.run("20", board=board, argv=argv)
    count = scene.random.randint(2, 12)
    until("the arm moves", lambda: len(board.frames()) >= count)
    time.sleep(scene.random.uniform(0.0, board.period))  # noqa: TID251, a random moment
    child = int(pid.read_text())
    kill(int(pid.with_suffix(".pid.parent").read_text()), signal.SIGKILL)
    begin = time.monotonic()
    if kind == "none":
        count = len(board.frames())
        until("more frames", lambda: len(board.frames()) > count + 5)
        kill(child, signal.SIGTERM)
        begin = time.monotonic()
    until("its end", lambda: child not in run.family())
    *_, before, hold = board.frames()
    scene.check(before.data == hold.data, "the last frame is not a hold")
    scene.figure(1000 * (hold.time - begin))
    (recording,) = scene.recordings()
    scene.check(list(frames_of(recording))[-1].data == hold.data, "it lacks the hold")
    scene.verified()


@row(
    "kill-9-server",
    "`kill -9` of a server that executes a goal while another one waits; then a new server",
    "the new one reports both goals as `server.restarted`, resumes neither, and opens no port",
    times=3,
)
def kill_server(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", "--policy", "queue", board=board)
    goals = [server.goal(20), server.goal(21)]
    until("the first frame", board.frames)
    time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
    scene.unrecorded = scene.unreceived = 1
    server.signal(signal.SIGKILL)
    server.wait()
    until("the end of its planners", lambda: not server.family())
    frames, resets = len(board.frames()), board.ask("state")["resets"]
    other = scene.serve("--policy", "queue", board=board)
    for goal in goals:
        result = other.result(goal)
        scene.check(result["code"] == "server.restarted", f"a goal is {result['code']}")
    scene.check(other.state() == "inactive", f"the arm is {other.state()}")
    refused = other.result(other.goal(21))
    scene.check(refused["code"] == "hw.not_active", f"a new goal: {refused['code']}")
    scene.check(board.ask("state")["resets"] == resets, "the port was opened")
    scene.check(len(board.frames()) == frames, "a frame was sent")
    other.post("/api/arm/activate")
    scene.succeeds(other, "after the activation")


@row(
    "kill-9-children",
    "`kill -9` of random child processes of a server: planners, and what finishes recordings",
    "goals succeed or end `plan.worker_died`, the next one succeeds; no recording is lost",
    times=3,
)
def kill_children(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    scene.injections = 0
    for task in (21, 23, 23, 21):
        goal = server.goal(task)
        time.sleep(scene.random.uniform(0.0, 0.8))  # noqa: TID251, a random moment
        if children := server.family():
            kill(scene.random.choice(children), signal.SIGKILL)
            scene.injections += 1
        result = server.result(goal)
        scene.check(result["code"] in ("ok", "plan.worker_died"), f"a goal ends {result['code']}")
    scene.succeeds(server, "the last goal")
    scene.check(scene.injections, "no child process was killed")
    server.signal(signal.SIGINT)
    scene.ended(server, 0)
    scene.recovered(0)
    scene.check(len(scene.recordings()) == 6, f"{len(scene.recordings())} recordings")
    scene.verified()


def way(start: Sequence[int], end: Sequence[int]) -> int:
    """By how much all servos turn from some angles to others [deg]."""
    return sum(abs(b - a) for a, b in zip(start, end, strict=True))


def reached(model: Sketch, frames: Sequence[Read], when: float) -> list[int]:
    """The angles of the servos at a time, from what a board has read since it booted."""
    for frame in (*(each for each in frames if each.time <= when), Read(when, b"")):
        while model.ring and model.free_at <= frame.time:
            model.work(model.free_at)
        model.receive(frame.data, frame.time)
    return model.reached(when)


class Stopped(NamedTuple):
    """A motion that was stopped. Times are those of the monotonic clock [s].

    Attributes:
        frames: Its frames that the board has read.
        when: When the stop was sent.
        late: By how much the board read a frame later than it was sent, after the stop [s];
            infinite if the motion had ended before.
    """

    frames: list[Read]
    when: float
    late: float


def stopped(scene: Scene, board: Board) -> Stopped:
    """Stop a quick motion."""
    earlier, count = len(board.frames()), round(1.5 / board.period)  # then the joints are quick
    run = scene.moving(board, "29", frames=(count, 2 * count))
    when = run.signal(signal.SIGINT)
    run.wait()
    sent = [each["time_s"] for each in run.events("sent") if each["joints"]]
    until("the board has read all", lambda: len(board.frames()) >= earlier + len(sent))
    frames = board.frames()[earlier:]
    pairs = zip(frames, sent, strict=False)
    lates = (frame.time - sent for frame, sent in pairs if frame.time > when)
    late = max(lates, default=math.inf)
    return Stopped(frames, when, late)


def stop_travel(firmware: type[Sketch], words: str, limit: float) -> Row:
    """A row: how long and how far servos turn after a stop."""
    name = "armtree" if firmware is OwnFirmware else "stock"

    @row(
        f"stop-travel-{name}",
        f"Ctrl-C at a random time of a quick motion of three joints, on a board with {words}",
        f"from then on, the servos turn by at most two frames of the motion, and {TRAVEL} degrees;"
        " the figure is how long. If a busy machine brings the board a frame half a period after"
        f" it was sent, or later, the fault is injected again, {TRIES} times at most",
        limit=limit,
        unit="ms",
        times=4,
    )
    def inject(scene: Scene) -> None:
        board = scene.board(name)
        for _ in range(TRIES):
            if (stop := stopped(scene, board)).late < board.period / 2:
                break
        until("the firmware has read all", lambda: board.ask("state")["backlog"] == 0)
        after = board.ask("state")
        turned = way(reached(firmware(), stop.frames, stop.when), after["angles"])
        angles = [[*map(int, re.findall(rb"\d{3}", each.data))] for each in stop.frames]
        most = min(TRAVEL, 2 * max(way(*pair) for pair in pairwise(angles)))
        late = f"the board read {1000 * stop.late:.0f} ms late"
        scene.check(turned <= most, f"the servos turned by {turned} degrees, not {most}; {late}")
        scene.figure(1000 * max(0.0, after["turned"] - stop.when))

    return inject


stop_travel_stock = stop_travel(Sketch, "the published sketch, which has read frames ahead", 250)
stop_travel_own = stop_travel(OwnFirmware, "the firmware `armtree`", 50)


@row(
    "stop-slow-disk",
    "Ctrl-C while a write to the recording does not return for 3 s",
    "the hold frame does not wait for it; the recording is complete",
    limit=50,
    unit="ms",
    times=3,
)
def stop_slow_disk(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, "-20.mcap")
    run = scene.moving(board, calls=calls)
    calls.start("delay 3000 once")
    until("a spoiled call", calls.calls)
    time.sleep(scene.random.uniform(0.0, 0.5))  # noqa: TID251, a random moment
    pressed = run.signal(signal.SIGINT)
    scene.ended(run, 7)
    *_, before, hold = board.frames()
    scene.check(before.data == hold.data, "the last frame is not a hold")
    scene.figure(1000 * (hold.time - pressed))
    scene.verified()


@row(
    "stop-slow-begin",
    "a stop while the first write to the recording of a server's goal does not return for 3 s",
    "the hold frame does not wait for it; the goal is canceled, and the next one is done",
    limit=50,
    unit="ms",
    times=3,
)
def stop_slow_begin(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, "-20.mcap")
    server = scene.serve("--activate", board=board, environment=calls.environment)
    server.result(server.goal(21))
    moved = len(board.frames())
    calls.start("delay 3000 once")
    goal = server.goal(20)
    until("a spoiled call", calls.calls)
    time.sleep(scene.random.uniform(0.0, 0.5))  # noqa: TID251, a random moment
    begin = time.monotonic()
    server.stop()
    until("the hold frame", lambda: len(board.frames()) > moved)
    *_, before, hold = board.frames()
    scene.check(before.data == hold.data, "the last frame is not a hold")
    scene.figure(1000 * (hold.time - begin))
    result = server.result(goal)
    scene.check(result["code"] == "goal.canceled", f"the goal ends {result}")
    result = server.result(server.goal(21))
    scene.check(result["code"] == "ok", f"the next goal ends {result}")
    server.signal(signal.SIGINT)
    scene.ended(server, 0)
    scene.verified()


@row(
    "sync",
    "count the syncs (fsync, fdatasync) of the recording of a run; the power is not cut",
    "there is one about every second, so a power failure should not lose more",
    limit=2,
    unit="s",
    times=2,
)
def sync(scene: Scene) -> None:
    calls = WrongCalls(scene.folder, ".mcap", "sync")
    calls.start("delay 0")
    run = scene.run("20", board=scene.board(), environment=calls.environment)
    run.until_event("sent", scene.random.randint(30, 50))
    end = run.signal(signal.SIGINT)
    run.wait()
    times = [each for each in calls.calls() if each < end]
    scene.check(len(times) > 2, f"{len(times)} syncs")
    for first, second in pairwise([*times, end]):
        scene.figure(second - first)
