"""The port disappears, and what was written is not what the board reads."""

from tests.faults.row import Scene, row


@row(
    "unplug",
    "unplug the board during a motion",
    "the goal ends `hw.port_lost` with exit status 6; nothing is sent afterwards",
    limit=70,
    unit="ms",
    times=12,
    quick=2,
)
def unplug(scene: Scene) -> None:
    board = scene.board()
    run = scene.run("20", board=board)
    run.until_event("sent", scene.random.randint(1, 12))
    scene.unreceived = 1
    gone = board.ask("unplug")["time"]
    scene.check(run.wait() == 6, f"exit status {run.wait()}, not 6")
    (result,) = run.events("result")
    scene.check(result["code"] == "hw.port_lost", f"the code is {result['code']}")
    failing = next(each for each in run.events("lifecycle") if each["label"] == "raise_error")
    scene.figure(1000 * (failing["time_s"] - gone))
    late = [each for each in run.events("sent") if each["time_s"] > failing["time_s"]]
    scene.check(not late, f"{len(late)} frames were sent after the fault")
    scene.verified()
