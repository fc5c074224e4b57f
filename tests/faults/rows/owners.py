"""Several programs on one port, things that are not a port, and an arm that a program drops."""

import fcntl
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

from tests.faults.process import until
from tests.faults.row import TASKS, Scene, last_line, motions_of, row
from tests.faults.rows.host import shifts

DROPS = """
import armtree, sys
arm = armtree.Arm(port={port!r}, robot={robot!r}, trees={trees!r})
arm.run(21)
{drop}
print("dropped", flush=True)
sys.stdin.read()
"""
WAYS_TO_DROP = (
    "del arm",
    "arm = None",
    "arm = [arm]; arm.append(arm); del arm; __import__('gc').collect()",
)


@row(
    "port-taken",
    "run a task on a port that another program has locked",
    "exit status 9 and the process id of that program; nothing is sent, and nothing resets",
    times=3,
)
def port_taken(scene: Scene) -> None:
    board = scene.board()
    other = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(other, fcntl.LOCK_EX)
    try:
        until("the board has booted", lambda: board.ask("state")["open"])
        run = scene.run("21", board=board)
        scene.ended(run, 9)
    finally:
        os.close(other)
    result = run.events("result")[-1]
    scene.check(result["code"] == "hw.port_busy", f"the code is {result['code']}")
    scene.check(f"{os.getpid()}" in result["message"], result["message"])
    scene.check(board.data() == b"", "something was sent")
    scene.check(board.ask("state")["resets"] == 1, "the board was reset")


@row(
    "two-runs",
    "start three commands on one port at the same time",
    "one runs undisturbed; the others end with exit status 9 and name its process id",
    times=4,
)
def two_runs(scene: Scene) -> None:
    board = scene.board()
    runs = []
    for _ in range(3):
        runs.append(scene.run("21", board=board))
        time.sleep(scene.random.uniform(0.0, 0.2))  # noqa: TID251, a random order
    status = sorted(run.wait() for run in runs)
    scene.check(status == [0, 9, 9], f"exit statuses {status}")
    owner = next((run for run in runs if run.wait() == 0), runs[0])
    for run in runs:
        if run is not owner:
            message = run.events("result")[-1]["message"]
            scene.check(re.search(rf"\b{owner.pid}\b", message), f"{owner.pid}: {message}")
    state = board.ask("state")
    scene.check(state["resets"] == 1, f"the board was reset {state['resets']} times")
    scene.verified()


@row(
    "two-servers",
    "start a server at the TCP port, and one on the serial port, of a server that moves an arm",
    "the first ends with exit status 13, the second leaves its arm inactive and names the process;"
    " the motion is undisturbed",
    limit=100,  # a period, by the log of the board
    unit="ms",
    times=3,
)
def two_servers(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    goal = server.goal(20)
    until("it moves", lambda: len(board.frames()) > 2)
    same = scene.armtree(
        *("serve", "--tcp-port", str(server.address[1]), "--port", "virtual"),
        *("--robot", scene.folder / "robot.toml", "--trees", TASKS),
    )
    scene.ended(same, 13, what="at the TCP port")
    scene.check(str(server.address[1]) in same.text(), f"it says {last_line(same)}")
    other = scene.serve(board=board)
    until("it is configured", lambda: other.state() == "inactive")  # it listens before that
    refused = other.post("/api/arm/activate")
    scene.check(refused.get("code") == "hw.port_busy", f"the second server: {refused}")
    scene.check(str(server.pid) in str(refused), f"it does not name {server.pid}: {refused}")
    scene.check(other.state() == "inactive", f"the second arm is {other.state()}")
    end = time.monotonic()
    until("frames after it", lambda: board.frames()[-1].time > end)
    scene.check(server.stop() < 1, "the first server does not stop")
    scene.check(server.result(goal)["state"] == "CANCELED", "the goal has ended")
    scene.check(board.ask("state")["resets"] == 1, "the board was reset")
    recording = max(scene.recordings(), key=lambda path: len(motions_of(path)))
    times = [each.time for each in board.frames()[:-1]]  # without the hold
    for gain, loss in shifts(times, motions_of(recording)):
        scene.figure(1000 * max(gain, loss))


@row(
    "port-shared",
    "a program that locks nothing sends a frame to the board during a motion",
    "with the firmware `armtree`, the goal ends `hw.frame_lost`; nothing is sent afterwards",
    limit=350,  # between two motions, no answer comes for so long
    unit="ms",
    times=4,
)
def port_shared(scene: Scene) -> None:
    board = scene.board("armtree")
    run = scene.moving(board, frames=(1, 60))
    scene.unrecorded, scene.unreceived = 1, 1
    other = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
    begin = time.monotonic()
    os.write(other, b"b091,s091,e091,g000,")
    os.close(other)
    scene.figure(1000 * (scene.faulted(run, "hw.frame_lost") - begin))
    scene.verified()


def no_port(kind: str, path: Path) -> Path:
    """Make something that is not a serial port, and return its path."""
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "file":
        path.write_text("precious")
    elif kind == "hard link":
        path.with_suffix(".origin").write_text("precious")
        path.hardlink_to(path.with_suffix(".origin"))
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(str(path))
    elif kind != "nothing":
        path.symlink_to({"loop": path.name, "dangling link": "nowhere"}.get(kind, kind))
    return path


NO_PORTS = (
    *("folder", "pipe", "file", "hard link", "socket", "nothing", "loop", "dangling link"),
    *("/dev/zero", "/dev/null", "/dev/full", "/dev/tty", "/dev/random"),
)


@row(
    "no-port",
    "`--port` names a folder, a pipe, a file, a link, a socket or a device that is not a port",
    "exit status 6 and one line that names it; nothing hangs, and no file is changed",
    times=2,
)
def not_a_port(scene: Scene) -> None:
    robot = scene.robot()
    kinds = scene.share(NO_PORTS)
    scene.injections = len(kinds)
    for kind in kinds:
        path = no_port(kind, scene.folder / f"port-{NO_PORTS.index(kind)}")
        run = scene.armtree(*("run", "21", "--port", path, "--robot", robot, "--trees", TASKS))
        scene.ended(run, 6, what=kind)
        lines = [line for line in run.text().splitlines() if not line.startswith("Port ")]
        named = [line for line in lines if str(path) in line]
        # Besides, a run prints its task, a hint and its recording.
        scene.check(len(named) == 1 and len(lines) < 5, f"{kind}: it says {lines}")
        if kind in ("file", "hard link"):
            scene.check(path.read_text() == "precious", f"the {kind} was changed")


@row(
    "dropped-arm",
    "a Python program drops an `armtree.Arm` without closing it",
    "its port is closed, while the program lives on; another command can use the board",
    limit=2,
    unit="s",
    times=3,
)
def dropped_arm(scene: Scene) -> None:
    board = scene.board()
    text = DROPS.format(
        port=str(board.port),
        robot=str(scene.robot()),
        trees=str(TASKS),
        drop=scene.share(WAYS_TO_DROP)[0],
    )
    program = scene.armtree("-c", text, argv=[sys.executable], stdin=subprocess.PIPE)
    program.until_printed("dropped")
    dropped = time.monotonic()
    until("the port is closed", lambda: not board.ask("state")["open"])
    scene.figure(time.monotonic() - dropped)
    scene.check(program.popen.poll() is None, "the program ended")
    run = scene.run("21", board=board)
    scene.ended(run, 0, what="the next run")
    scene.verified()


@row(
    "doctor",
    "`doctor --open` on a board that does not answer, is another one, is missing or is taken",
    "it says what is wrong, and not that the board is ready; the exit status is that of a run: 6 or"
    " 9. A board that answers is ready",
    times=2,
)
def doctor(scene: Scene) -> None:
    wrong = {"mute": "board", "stock": "board", "missing": "port", "taken": "ours alone"}
    for kind in (*wrong, "well"):  # the first one writes the robot file
        board = scene.board("stock" if kind == "stock" else "armtree")
        handle = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
        if kind == "mute":
            board.ask("mute")
        elif kind == "taken":
            fcntl.flock(handle, fcntl.LOCK_EX)
        elif kind == "missing":
            board.ask("unplug")
        if kind != "taken":
            os.close(handle)
        robot = scene.folder / "robot.toml"
        found = scene.armtree("doctor", "--open", "--port", board.port, "--robot", robot)
        scene.ended(found, {"taken": 9, "well": 0}.get(kind, 6), what=kind)
        if kind == "taken":
            os.close(handle)
        refused = re.findall(r"^NO  (.*?)  ", found.text(), re.MULTILINE)
        scene.check(refused == ([wrong[kind]] if kind in wrong else []), f"{kind}: no {refused}")
        ready = re.search(r"^ok  board ", found.text(), re.MULTILINE)
        scene.check(bool(ready) is (kind == "well"), f"{kind}: {ready or 'the board is not ready'}")
        data = b"" if kind in wrong else b"bA01;"  # it asks for acknowledgements
        scene.check(board.data() == data, f"{kind}: {board.data()!r} was sent")
        board.close()
    scene.unrecorded = 2  # the pieces of that command


@row(
    "runtime-folder",
    "there is no `XDG_RUNTIME_DIR`, and in the folder for temporary files, the folder of armtree is"
    " a link, a file, a pipe, open to other users, or, if root injects the fault, another user's",
    "the server ends with exit status 13 and names that folder; nothing is written there",
    times=6,
)
def runtime_folder(scene: Scene) -> None:
    temporary, other = scene.folder / "tmp", scene.folder / "other"
    temporary.mkdir()
    other.mkdir(mode=0o700)
    folder = temporary / f"armtree-{os.getuid()}"
    foreign = ["another user's folder"] if os.getuid() == 0 else []
    (kind,) = scene.share(["link", "dangling link", "file", "pipe", "open folder", *foreign])
    if kind == "open folder":
        folder.mkdir()
        folder.chmod(0o777)
    elif kind in foreign:
        folder.mkdir(mode=0o700)
        os.chown(folder, 65534, 65534)  # nobody
    elif kind == "link":
        folder.symlink_to(other)
    else:
        no_port(kind, folder)
    before = folder.lstat()
    environment = {"XDG_RUNTIME_DIR": "", "TMPDIR": str(temporary)}
    server = scene.armtree(
        *("serve", "--tcp-port", "0", "--port", "virtual"), environment=environment
    )
    scene.ended(server, 13, what=kind)
    scene.check(str(folder) in server.text(), f"{kind}: {last_line(server)}")
    scene.check(folder.lstat().st_mode == before.st_mode, f"{kind}: it was changed")
    there = [*other.iterdir(), *(folder.iterdir() if folder.is_dir() else ())]
    scene.check(not there, f"{kind}: {there} was written")
