"""Signals, and the end of the process that started the command."""

import signal
import time
from itertools import pairwise

from tests.faults.process import kill, until
from tests.faults.row import Scene, row
from tests.faults.wrong_calls import WrongCalls


@row(
    "signals",
    "SIGINT, SIGTERM or SIGHUP during a motion",
    "the arm is stopped with a hold frame, the recording finished; exit status 7",
    limit=300,
    unit="ms",
    times=9,
    quick=1,
)
def signals(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board)
    (which,) = scene.share([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    sent = run.signal(which)
    scene.ended(run, 7, what=which.name)
    hold = run.events("sent")[-1]
    scene.check(hold["hold"], f"{which.name}: the last frame is not a hold")
    scene.figure(1000 * (hold["time_s"] - sent))
    scene.verified()


@row(
    "signals-early",
    "SIGINT, SIGTERM or SIGHUP at a random time from the start of the command to its first motion",
    "it ends, with exit status 130 or 7 or by the signal itself, without a traceback",
    limit=3,
    unit="s",
    times=10,
)
def signals_early(scene: Scene) -> None:
    board = scene.board()
    run = scene.run("20", board=board)
    time.sleep(scene.random.uniform(0.0, 3.0))  # noqa: TID251, a random moment
    which = scene.random.choice([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    sent = run.signal(which)
    allowed = (7, 130, 128 + which, -which)
    scene.ended(run, *allowed, what=which.name)
    scene.figure(time.monotonic() - sent)
    until("the end of its processes", lambda: not run.family())


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
    server.signal(signal.SIGINT)
    scene.ended(server, 0)
    scene.recovered(0)
    scene.check(len(scene.recordings()) == 6, f"{len(scene.recordings())} recordings")
    scene.verified()


@row(
    "stop-travel",
    "Ctrl-C at a random time of a motion, on a board with the published sketch, which has read"
    " frames ahead",
    "from then on, the servos turn by at most 32 degrees in total",
    limit=32,
    unit="deg",
    times=6,
)
def stop_travel(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board, frames=(5, 30))
    run.signal(signal.SIGINT)
    before = board.ask("state")["angles"]
    run.wait()
    until("the board has read all", lambda: board.ask("state")["backlog"] == 0)
    after = board.ask("state")["angles"]
    scene.figure(sum(abs(b - a) for a, b in zip(before, after, strict=True)))


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
