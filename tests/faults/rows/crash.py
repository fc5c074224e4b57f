"""The process is killed while it records, or a skill ends it."""

import signal
import time

from tests.faults.process import until
from tests.faults.row import Scene, last_line, row

_HEAD = "import os, posix, sys\nfrom armtree import skill\n"
_FUNCTION = "@skill\ndef leave() -> None:\n    {}\n"
_CLASS = (
    "from py_trees.common import Status\nfrom armtree import Skill\n"
    "class leave(Skill):\n    def on_start(self) -> Status:\n        {}\n"
)
CALLS = (
    *("os._exit(0)", "posix._exit(0)", "sys.exit(0)", "os.execv('/bin/true', ['true'])"),
    "os.chdir('/')",
)
_FORKING = "os.fork() or os._exit(0)\n    os.wait()\n"


@row(
    "kill-9",
    "`kill -9` at a random moment of a run",
    "`log recover` keeps every frame but at most the one in flight, and what it keeps holds",
    times=8,
    quick=1,
)
def kill(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board, frames=(1, 20))
    scene.unrecorded = scene.unreceived = 1
    run.signal(signal.SIGKILL)
    run.wait()
    until("its processes end", lambda: not run.family())
    scene.recovered(0, 10)
    scene.verified(10)


@row(
    "kill-9-early",
    "`kill -9` of a run while it starts, while the board boots, or while it plans",
    "the next run on this board is done; of the first one, only a recording is left, which holds or"
    " is recovered, and a lock file that the next `armtree stop` removes",
    times=6,
)
def kill_early(scene: Scene) -> None:
    board = scene.board()
    (phase,) = scene.share(["starts", "boots", "plans"])
    run = scene.run("20", board=board)
    if phase == "boots":
        until("it boots", lambda: board.ask("state")["open"])
    elif phase == "plans":
        run.until_event("lifecycle", 4)  # configured and activated
    longest = {"starts": 0.6, "boots": 1.0, "plans": 0.2}[phase]
    time.sleep(scene.random.uniform(0.0, longest))  # noqa: TID251, a random moment
    scene.unrecorded = scene.unreceived = 1
    run.signal(signal.SIGKILL)
    run.wait()
    until("its processes end", lambda: not run.family())
    again = scene.run("21", board=board)
    scene.ended(again, 0, what=f"after a kill while it {phase}")
    scene.armtree("stop").wait()
    left = [each.name for each in scene.folder.glob("armtree/*")]
    left += [each.name for each in scene.folder.glob("recordings/*") if each.suffix != ".mcap"]
    scene.check(not left, f"{left} is left")
    scene.verified(0, 10)


@row(
    "skill-exits",
    "a skill calls `os._exit(0)`, `posix._exit(0)`, `sys.exit(0)`, `os.execv` or `os.chdir`: in a"
    " function, in a class, or when it is loaded",
    "the command fails and says which skill; a child process of a skill may still end. C code, such"
    " as a library called with `ctypes`, and a function that a skill leaves to `atexit` can end the"
    " command; this is not injected",
    times=5,
)
def skill_exits(scene: Scene) -> None:
    task = "task: 24\nname: leave\ndescription: Leave.\ntree:\n  leave: {}\n"
    (call,) = scene.share(CALLS)
    kinds = {
        "function": (_FUNCTION.format(call), 11, "leave: SystemExit"),
        "class": (_CLASS.format(call), 11, "leave.on_start"),
        "module": (f"{call}\n", 3, "leave.py"),
        "fork": (_FUNCTION.format(_FORKING), 0, ""),
    }
    scene.injections = len(kinds)
    for kind, (text, status, words) in kinds.items():
        scene.write({"trees/24_leave.yaml": task, "skills/leave.py": _HEAD + text})
        run = scene.run("24", "--skills", scene.folder / "skills")
        scene.ended(run, status, what=f"{call} in a {kind}")
        scene.check(words in run.text(), f"{call} in a {kind}: without {words}: {last_line(run)}")
