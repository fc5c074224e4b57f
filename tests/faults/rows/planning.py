"""Planners lie, die, hang, or are starved of memory."""

from pathlib import Path

from tests.faults.process import until
from tests.faults.row import Scene, row

PRELOAD = Path(__file__).parents[1] / "preload" / "planner"


# As the file in that folder names them.
LIES = (
    "nothing",
    "a text",
    "empty",
    "shapes",
    "flat",
    "unknown joints",
    "other group",
    "three times the speed",
    "twenty times the speed",
    "a year",
    "end off",
    "start off",
    "jump",
    "huge",
    "durations",
)


@row(
    "planner-lies",
    "a planner answers with another plan: other shapes, joints, limits, start, goal, duration",
    "the goal ends `plan.worker_died` with what is wrong; no frame is sent; the next goal succeeds",
    times=2,
    quick=1,
)
def planner_lies(scene: Scene) -> None:
    board = scene.board()
    fault = scene.folder / "fault"
    environment = {"PYTHONPATH": str(PRELOAD), "PLANNER_FAULT": str(fault)}
    server = scene.serve("--activate", board=board, environment=environment)
    until("the arm is active", lambda: server.state() == "active")
    scene.injections = len(LIES)
    for kind in scene.random.sample(LIES, len(LIES)):
        before = len(board.frames())
        fault.write_text(kind)
        result = server.result(server.goal(21))
        scene.check(not fault.exists(), f"{kind}: the planner was not asked")
        code, message = result["code"], result["message"]
        scene.check(code == "plan.worker_died", f"{kind}: the code is {code}: {message}")
        scene.check("answered" in message, f"{kind}: the message is {message}")
        scene.check(len(board.frames()) == before, f"{kind}: frames were sent")
        honest = server.result(server.goal(21))
        scene.check(honest["code"] == "ok", f"after {kind}: {honest['code']}: {honest['message']}")
