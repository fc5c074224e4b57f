"""The process is killed while it records, or a skill ends it."""

import signal

from tests.faults.process import until
from tests.faults.row import Scene, last_line, row

_HEAD = "import os, sys\nfrom armtree import skill\n"
_FUNCTION = "@skill\ndef leave() -> None:\n    {}\n"
_CLASS = (
    "from py_trees.common import Status\nfrom armtree import Skill\n"
    "class leave(Skill):\n    def on_start(self) -> Status:\n        {}\n"
)
_FORKING = "os.fork() or os._exit(0)\n    os.wait()\n"


@row(
    "kill-9",
    "`kill -9` at a random moment of a run",
    "`log recover` keeps every frame but at most the one in flight, and what it keeps holds",
    times=12,
    quick=1,
)
def kill(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board, frames=(1, 20))
    scene.unrecorded = scene.unreceived = 1
    run.signal(signal.SIGKILL)
    run.wait()
    until("its processes end", lambda: not run.family())
    recover = scene.armtree("log", "recover", *scene.recordings())
    scene.check(recover.wait() in (0, 10), f"log recover ends with {recover.wait()}")
    verify = scene.armtree("replay", "recordings", "--verify")
    scene.check(verify.wait() == 10, f"replay --verify ends with {verify.wait()}, not 10")


@row(
    "skill-exits",
    "a skill calls `os._exit(0)` or `sys.exit(0)`: in a function, in a class, or when it is loaded",
    "the command fails and says which skill; a child process of a skill may still end",
    times=6,
)
def skill_exits(scene: Scene) -> None:
    trees, skills = scene.folder / "trees", scene.folder / "skills"
    trees.mkdir()
    skills.mkdir()
    (trees / "24_leave.yaml").write_text(
        "task: 24\nname: leave\ndescription: Leave.\ntree:\n  leave: {}\n"
    )
    (call,) = scene.share(["os._exit(0)", "sys.exit(0)"])
    kinds = {
        "function": (_FUNCTION.format(call), 11, "leave"),
        "class": (_CLASS.format(call), 11, "leave.on_start"),
        "module": (f"{call}\n", 3, "leave.py"),
        "fork": (_FUNCTION.format(_FORKING), 0, ""),
    }
    scene.injections = len(kinds)
    for kind, (text, status, words) in kinds.items():
        (skills / "leave.py").write_text(_HEAD + text)
        run = scene.run("24", "--skills", skills)
        found = f"{call} in a {kind}: exit status {run.wait()}: {last_line(run)}"
        scene.check(run.wait() == status, f"{found}; not {status}")
        scene.check(words in run.text(), f"{found}; without {words}")
