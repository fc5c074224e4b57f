"""The process is killed while it records."""

import signal

from tests.faults.process import until
from tests.faults.row import Scene, row


@row(
    "kill-9",
    "`kill -9` at a random moment of a run",
    "`log recover` keeps every frame but at most the one in flight, and what it keeps holds",
    times=12,
    quick=1,
)
def kill(scene: Scene) -> None:
    board = scene.board()
    run = scene.run("20", board=board)
    run.until_event("sent", scene.random.randint(1, 20))
    scene.unrecorded = scene.unreceived = 1
    run.signal(signal.SIGKILL)
    run.wait()
    until("its processes end", lambda: not run.family())
    recover = scene.armtree("log", "recover", *scene.recordings())
    scene.check(recover.wait() in (0, 10), f"log recover ends with {recover.wait()}")
    verify = scene.armtree("replay", "recordings", "--verify")
    scene.check(verify.wait() == 10, f"replay --verify ends with {verify.wait()}, not 10")
