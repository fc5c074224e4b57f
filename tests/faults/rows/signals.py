"""Signals, and the end of the process that started the command."""

import signal
import time

from tests.faults.process import until
from tests.faults.row import Scene, row


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
    run = scene.run("20", board=board)
    run.until_event("sent", scene.random.randint(1, 12))
    which = scene.random.choice([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    sent = run.signal(which)
    scene.check(run.wait() == 7, f"{which.name}: exit status {run.wait()}, not 7")
    hold = run.events("sent")[-1]
    scene.check(hold["hold"], f"{which.name}: the last frame is no hold")
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
    scene.check(run.wait() in allowed, f"{which.name}: exit status {run.wait()}")
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
    result = other.result(other.goal(21))
    scene.check(result["code"] == "ok", f"after the activation: {result['code']}")
