"""What surrounds the command: files that never end, readers that end first, closed terminals."""

import itertools
import json
import math
import os
import signal
import socket
import sys
import time
from pathlib import Path

from tests.faults.board import Board
from tests.faults.means.wrong_calls import WrongCalls
from tests.faults.process import ARMTREE, Command, until
from tests.faults.row import TASKS, Scene, frames_of, last_line, row

# Runs a command, reads so many lines of its output, and closes the pipe.
READER = """
import subprocess, sys
with subprocess.Popen(sys.argv[2:], stdout=subprocess.PIPE) as process:
    for _ in range(int(sys.argv[1])):
        sys.stdout.buffer.write(process.stdout.readline())
    process.stdout.close()
    status = process.wait()
sys.exit(status if status >= 0 else 128 - status)
"""

# Runs a command on a terminal of its own. When a file appears, types what it holds, or closes the
# terminal if it holds nothing.
TERMINAL = """
import fcntl, os, pathlib, sys, termios, time
master, slave = os.openpty()
if not (pid := os.fork()):
    os.setsid()
    fcntl.ioctl(slave, termios.TIOCSCTTY, 0)
    for number in range(3):
        os.dup2(slave, number)
    os.closerange(3, 20)
    os.execv(sys.argv[2], sys.argv[2:])
os.close(slave)
os.set_blocking(master, False)
keys = pathlib.Path(sys.argv[1])
while True:
    if keys.exists():
        typed = keys.read_bytes()
        if not typed:
            break
        os.write(master, typed)
        keys.unlink()
    try:
        os.write(1, os.read(master, 65536))
    except BlockingIOError:
        time.sleep(0.001)
    except OSError:  # it has ended
        break
os.close(master)
status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
sys.exit(status if status >= 0 else 128 - status)
"""


ENDED_S = 3.0  # a command has stopped the arm and finished its recording
KINDS = ("pipe", "socket", "zero", "folder", "big", "brackets")


@row(
    "endless-files",
    "`--robot`, `--world`, `urdf`, a task or a file of `--skills` on a pipe, a socket, a device, a"
    " folder, a file of 1 GB or 100,000 brackets; `baud = 1`",
    "exit status 3 and one message that names it, or the file of skills is left out; nothing"
    " hangs, and the memory of each process stays below 400 MiB",
    limit=20,
    unit="s",
    times=16,
    quick=1,
)
def endless_files(scene: Scene) -> None:
    cases = itertools.product(("--robot", "--world", "urdf", "task", "skills"), KINDS)
    tried = scene.share([*cases, ("baud", "1"), ("baud", "1000000000000")])
    scene.injections = len(tried)
    for what, kind in tried:
        folder = scene.folder / f"{what}-{kind}"
        folder.mkdir()
        arguments, path = endless_case(scene, folder, what, kind)
        begin, most = time.monotonic(), 0.0
        command = scene.armtree(*arguments)
        while command.popen.poll() is None and time.monotonic() < begin + 60:
            most = max(most, command.most_memory())
            time.sleep(0.01)  # noqa: TID251, it watches another process
        scene.figure(time.monotonic() - begin)
        where = f"{what} {kind}"
        expected = 0 if what == "skills" else 3
        scene.ended(command, expected, what=where)
        scene.check(path.name in command.text(), f"{where}: not named: {last_line(command)}")
        lines = len(command.text().splitlines())
        most_lines = {"task": 7, "skills": math.inf}.get(what, 5)  # a run also has a recording
        scene.check(lines <= most_lines, f"{where}: {lines} lines")
        scene.check(most < 400, f"{where}: {most:.0f} MiB")


def endless_case(scene: Scene, folder: Path, what: str, kind: str) -> tuple[list[str | Path], Path]:
    """The arguments of a command, and the file that it must name."""
    plan: list[str | Path] = ["plan", "right", "-o", scene.folder / "plan.png"]
    run: list[str | Path] = ["run", "21", "--port", "virtual"]
    if what == "baud":
        path = scene.robot({"baud = 115200": f"baud = {kind}"})
        return [*run, "--robot", path, "--trees", TASKS], path
    path = endless(folder, kind)
    if what == "urdf":
        return [*plan, "--robot", scene.robot({f'"{shipped_urdf()}"': json.dumps(str(path))})], path
    if what == "task":
        path = path.rename(folder / "77_endless.yaml")
        return ["run", "77", "--port", "virtual", "--trees", folder], path
    if what == "skills":
        path = path.rename(folder / "endless.py")
        return [*run, "--skills", folder, "--trees", TASKS], path
    return [*plan, what, path], path


def shipped_urdf() -> Path:
    from tests.support.paths import ROBOT_FILE

    return ROBOT_FILE.with_suffix(".urdf")


def endless(folder: Path, kind: str) -> Path:
    """Make a file that a reader must not trust."""
    path = folder / "endless"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(path))
    elif kind == "zero":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "big":
        with path.open("wb") as stream:
            stream.truncate(10**9)
    else:
        path.write_text("a = " + "[" * 100_000)
    return path


@row(
    "reader-ends",
    "the reader of a command's output ends after some lines, as `head -1` in a pipe does",
    "a command that only prints is quiet and ends with 141, or 0 if all was printed before; "
    "a run continues, and has its own status",
    times=4,
)
def reader_ends(scene: Scene) -> None:
    lines = scene.random.randint(0, 2)
    argv = (sys.executable, "-c", READER, str(lines), ARMTREE)
    command = scene.armtree(scene.random.choice(["tasks", "skills"]), argv=argv)
    # A command that has printed all before its reader ends has not noticed it.
    expected = (0, 141) if lines else (141,)
    scene.ended(command, *expected, what=f"after {lines} lines")
    scene.check(not command.errors.read_text(), f"it prints {command.errors.read_text()!r}")
    board = scene.board()
    run = scene.run("21", board=board, argv=argv)
    scene.ended(run, 0)
    scene.verified()


@row(
    "closed-streams",
    "a run whose standard streams are closed: input, output, errors, or all of them",
    "the arm moves until Ctrl-C; no file, such as the port, takes the number of a closed stream",
    times=4,
)
def closed_streams(scene: Scene) -> None:
    (closed,) = scene.share([[1], [2], [0, 1], [0, 1, 2]])
    board = scene.board()
    argv = ("sh", "-c", f'exec "$@" {" ".join(f"{number}>&-" for number in closed)}', "sh", ARMTREE)
    run = scene.run("20", board=board, argv=argv)
    moving(board, 3)
    for number in closed:
        leads = os.readlink(f"/proc/{run.pid}/fd/{number}")
        scene.check(leads == "/dev/null", f"{closed} closed: {number} leads to {leads}")
    run.signal(signal.SIGINT)
    scene.ended(run, 7, what=f"{closed}")
    scene.check(len(board.frames()) * 20 == len(board.data()), f"{closed}: more than frames")
    scene.verified()


# Runs a command, and writes its exit status to a file; an interactive shell does not report it.
NOTES_STATUS = """
import pathlib, signal, subprocess, sys
signal.signal(signal.SIGHUP, lambda *_: None)  # not ignored, which the command would inherit
file, *command = sys.argv[1:]
pathlib.Path(file).write_text(str(subprocess.call(command)))
"""


@row(
    "closed-terminal",
    "the terminal of a run, started by an interactive shell or by no shell, is closed during a"
    " motion",
    "the arm is stopped with a hold frame, the recording finished; exit status 7",
    limit=3,
    unit="s",
    times=4,
)
def closed_terminal(scene: Scene) -> None:
    board, keys = scene.board(), scene.folder / "keys"
    shells: list[tuple[str | Path, ...]] = [
        (),
        ("/bin/bash", "--norc", "-ic", '"$@"; exit', "bash"),
    ]
    (shell,) = scene.share(shells)
    noted = scene.folder / "status"
    # Without a shell, the command itself must be the leader of the session, which is signaled.
    argv = (*shell, sys.executable, "-c", NOTES_STATUS, noted) if shell else ()
    run = on_terminal(scene, board, keys, "run", "20", shell=argv)
    in_motion(scene, board)
    begin = time.monotonic()
    keys.touch()
    run.wait()
    until("its end", lambda: not run.family())
    scene.figure(time.monotonic() - begin)
    status = noted.read_text() if shell else str(run.wait())
    scene.check(status == "7", f"exit status {status}")
    (recording,) = scene.recordings()
    *_, before, hold = frames_of(recording)
    scene.check(before.data == hold.data, "the last frame is not a hold")
    scene.verified()


@row(
    "typed-ctrl-c",
    "a person types Ctrl-C in the terminal of a run during a motion, once or twice",
    "the arm is stopped with a hold frame, exit status 7, and the recording holds; twice: the"
    " command ends at once with 130, or with 7 if it had stopped before. Figures: the last frame on"
    " the wire, and for twice the end of the command",
    limit=300,
    unit="ms",
    times=4,
)
def typed_ctrl_c(scene: Scene) -> None:
    board, keys = scene.board(), scene.folder / "keys"
    (count,) = scene.share([1, 2])
    run = on_terminal(scene, board, keys, "run", "20")
    in_motion(scene, board)
    begin = time.monotonic()
    for _ in range(count):
        type_keys(keys, b"\x03")
    scene.ended(run, *((7,) if count == 1 else (7, 130)), what=f"typed {count} times")
    ended = time.monotonic()
    frames = board.frames()
    if count == 1 or run.wait() == 7:
        scene.check(frames[-1].data == frames[-2].data, "the last frame is not a hold")
        scene.verified()
    else:
        scene.unrecorded = scene.unreceived = 1
        scene.figure(1000 * (ended - begin), "end")
        scene.recovered(0, 10)
    scene.check(
        ended - begin < ENDED_S, f"typed {count} times, it ended after {ended - begin:.1f} s"
    )
    scene.figure(1000 * max(0.0, frames[-1].time - begin))


def on_terminal(
    scene: Scene, board: Board, keys: Path, *words: str, shell: tuple[str | Path, ...] = ()
) -> Command:
    """A command on a terminal of its own; a shell there may start it."""
    argv = (sys.executable, "-c", TERMINAL, keys, *shell, ARMTREE)
    common: list[str | Path] = ["--port", board.port, "--robot", scene.robot(), "--trees", TASKS]
    return scene.armtree(*words, *common, argv=argv)


def in_motion(scene: Scene, board: Board, most: int = 12) -> None:
    """Wait until a random moment after at most so many frames."""
    moving(board, scene.random.randint(2, most))
    time.sleep(scene.random.uniform(0.0, board.period))  # noqa: TID251, a random moment


def type_keys(keys: Path, data: bytes) -> None:
    """Type keys at a terminal."""
    typed = keys.with_suffix(".new")
    typed.write_bytes(data)
    typed.rename(keys)
    until("it is typed", lambda: not keys.exists())


def moving(board: Board, frames: int) -> None:
    """Wait until the board has read so many frames."""
    until(f"frame {frames}", lambda: len(board.frames()) >= frames)


@row(
    "two-ctrl-c",
    "two Ctrl-C, 0.6 to 1 s apart, while a write to the recording does not return for a minute",
    "the process ends with 130, without waiting for the write",
    limit=3,
    unit="s",
    times=3,
    quick=1,
)
def two_ctrl_c(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, ".mcap")
    run = scene.moving(board, calls=calls)
    calls.start("delay 60000")
    until("a spoiled call", calls.calls)
    scene.unrecorded = 2  # the frame in flight, and the hold of the stop
    run.signal(signal.SIGINT)
    time.sleep(scene.random.uniform(0.6, 1.0))  # noqa: TID251, a person needs some time
    begin = run.signal(signal.SIGINT)
    scene.ended(run, 130)
    scene.figure(time.monotonic() - begin)
