"""Signals, and the end of the process that started the command."""

import signal

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
