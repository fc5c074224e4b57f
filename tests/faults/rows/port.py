"""The port disappears, returns, takes no bytes, or takes them in pieces."""

import contextlib
import itertools
import os
import random
import signal
import time
from pathlib import Path

from tests.faults.board import Board
from tests.faults.means.wrong_calls import WrongCalls
from tests.faults.process import Server, until
from tests.faults.row import Scene, row
from tests.faults.rows.bus import in_motion as bus_in_motion, running as bus_running


@row(
    "unplug",
    "unplug the board during a motion",
    "the goal ends `hw.port_lost` with exit status 6; nothing is sent afterwards",
    limit=70,
    unit="ms",
    times=8,
    quick=1,
)
def unplug(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board)
    scene.unreceived = 1
    gone = board.ask("unplug")["time"]
    scene.figure(1000 * (scene.faulted(run, "hw.port_lost") - gone))
    scene.verified()


@row(
    "unplug-any-time",
    "unplug the board at a random time from the start of the command: it boots, plans or moves",
    "the run ends with exit status 6 and a code of the port; nothing hangs",
    limit=1,
    unit="s",
    times=5,
)
def unplug_any_time(scene: Scene) -> None:
    board = scene.board()
    run = scene.run("20", board=board)
    time.sleep(scene.random.uniform(0.0, 4.0))  # noqa: TID251, a random moment
    scene.unreceived = 1
    gone = board.ask("unplug")["time"]
    scene.ended(run, 6)
    ended = time.monotonic()
    code = run.events("result")[-1]["code"]
    scene.check(code in ("hw.port_lost", "hw.port_missing", "hw.link"), f"the code is {code}")
    for opening in run.events("lifecycle"):
        if opening["label"] == "activate":  # else the port was gone before
            scene.figure(ended - max(gone, opening["time_s"]))


@row(
    "replug",
    "unplug the board of a server during a motion, and plug it in again",
    "the server opens no port and moves nothing until a person activates the arm; then it works",
    times=4,
)
def replug(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    goal = server.goal(20)
    until("the first frame", board.frames)
    time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
    scene.unreceived = 1
    board.ask("unplug")
    result = server.result(goal)
    scene.check(result["code"] == "hw.port_lost", f"the code is {result['code']}")
    until("the fault is processed", lambda: server.state() == "unconfigured")
    returned(scene, server, board, board.ask("replug ttyACM0")["resets"])


def returned(scene: Scene, server: Server, board: Board, resets: int) -> None:
    """Check that a server leaves a board alone that came back, until a person activates it."""
    refused = server.result(server.goal(21))
    scene.check(refused["code"] == "hw.not_active", f"a goal meanwhile: {refused['code']}")
    time.sleep(scene.random.uniform(0.5, 1.5))  # noqa: TID251, the server could open it meanwhile
    now = board.ask("state")
    scene.check(now["resets"] == resets, "the server opened the port by itself")
    server.post("/api/arm/configure")
    server.post("/api/arm/activate")
    scene.succeeds(server, "after the activation")
    scene.check(board.ask("state")["angles"] == [90, 90, 90, 0], "the board is elsewhere")


BY_ID = Path("/dev/serial/by-id")


def remove_empty(*folders: Path) -> None:
    """Remove folders that this program may have made."""
    with contextlib.suppress(OSError):
        for each in folders:
            each.rmdir()


def persistent(scene: Scene, board: Board) -> Path:
    """A link to the port, as udev makes it: named after the board, not after the plug."""
    name, folder = f"usb-armtree-faults-{random.randrange(10**9)}", BY_ID
    try:
        folder.mkdir(parents=True, exist_ok=True)
        scene.cleanup.callback(remove_empty, folder, folder.parent)
    except OSError:  # only root may
        folder = scene.folder / "by-id"
        folder.mkdir()
    scene.by(f"a link in {folder}" if folder == BY_ID else "a link elsewhere than in /dev")
    path = folder / name
    path.symlink_to(board.port)
    scene.cleanup.callback(path.unlink, missing_ok=True)
    return path


@row(
    "replug-other-name",
    "unplug the board of a server during a motion, and plug it in again: it gets another device"
    " name, to which its link in `/dev/serial/by-id` then leads",
    "the server moves nothing until a person activates the arm; then it works, on the other device",
    times=3,
)
def replug_other_name(scene: Scene) -> None:
    board = scene.board()
    link = persistent(scene, board)
    board.at(link)
    server = scene.serve("--activate", board=board)
    goal = server.goal(20)
    until("the first frame", board.frames)
    time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
    scene.unreceived = 1
    before = os.path.realpath(link)
    board.ask("unplug")
    link.unlink()
    result = server.result(goal)
    scene.check(result["code"] == "hw.port_lost", f"the code is {result['code']}")
    until("the fault is processed", lambda: server.state() == "unconfigured")
    time.sleep(scene.random.uniform(0.2, 1.0))  # noqa: TID251, so long it is unplugged
    taken = ends_up_to(before)  # so that the kernel gives the board another one
    resets = board.ask("replug ttyACM7")["resets"]
    for each in taken:
        os.close(each)
    link.symlink_to(scene.folder / "ttyACM7")
    scene.check(os.path.realpath(link) != before, f"the device is {before} again")
    if link.parent == BY_ID:
        server.until_printed(f"is back as {os.path.realpath(link)}")
    returned(scene, server, board, resets)


def ends_up_to(device: str) -> list[int]:
    """Open pseudo-terminals until this device is taken; return their descriptors.

    The kernel gives the lowest free number.
    """
    ends = list[int]()
    while not ends or int(Path(os.ttyname(ends[-1])).name) < int(Path(device).name):
        ends += os.openpty()
    return ends


@row(
    "stalled-board",
    "the board reads nothing more during a motion, and the buffer of the kernel is full",
    "the goal ends `hw.port_stalled` with exit status 6; the board has read every frame before it"
    " stopped to read, and none follows when it reads again",
    # A write may take 300, so that a busy computer does not end a goal; 250 was the aim. It waits
    # up to a period behind the frames before it.
    limit=450,
    unit="ms",
    times=3,
)
def stalled_board(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board)
    board.ask("stall")
    fill(board)
    scene.unrecorded, scene.unreceived = 1, 4  # what filled the buffer; frames meanwhile
    failed = scene.faulted(run, "hw.port_stalled")
    sent = [each["time_s"] for each in run.events("sent")]
    *before, motion = run.events("schedule")
    done = len(sent) - sum(len(each["times"]) for each in before)
    due = motion["time_s"] if done == 0 else sent[-done] - motion["times"][0]
    scene.figure(1000 * (failed - due - motion["times"][done]))
    board.ask("go")
    scene.verified()
    scene.check(len(board.frames()) <= len(sent), "it has read more frames than were sent")


def fill(board: Board) -> None:
    """Write to the port of a stalled board until the kernel takes no more."""
    other = os.open(board.port, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    taken = True
    while taken:
        taken = False
        with contextlib.suppress(BlockingIOError):
            while os.write(other, b"x" * 64):
                taken = True
        time.sleep(0.05)  # noqa: TID251, the kernel moves bytes from one buffer to the next
    os.close(other)


@row(
    "write-without-end",
    "writes to the port of the serial board, or of a bus of servos, make no progress: they fail"
    " with EAGAIN for ever, take zero bytes, or return after seconds",
    "the goal ends `hw.port_stalled` with exit status 6; then no call is made again",
    limit=400,  # the deadline of 300, and the last call that was made before it
    unit="ms",
    times=8,
    quick=1,
)
def write_without_end(scene: Scene) -> None:
    kinds = itertools.product(("board", "bus"), ("errno 11", "zero", "delay 4000", "hang 150"))
    ((what, how),) = scene.share(kinds)
    with contextlib.ExitStack() as stack:
        if what == "bus":
            file, bus = stack.enter_context(bus_running(scene.folder))
            calls = WrongCalls(scene.folder, bus.port)
            run = bus_in_motion(scene, file, bus, calls.environment)
        else:
            board = scene.board()
            calls = WrongCalls(scene.folder, board.port)
            run = scene.moving(board, calls=calls)
        scene.unreceived = 1
        calls.start(how)
        until("a spoiled call", calls.calls)
        failed = scene.faulted(run, "hw.port_stalled")
        scene.figure(1000 * (failed - calls.calls()[0]))
        late = [each for each in calls.calls() if each > failed]
        scene.check(not late, f"{what}, {how}: {len(late)} calls after the fault")
    scene.verified()


@row(
    "write-stuck-ctrl-c",
    "Ctrl-C while a write to the port does not return",
    "the command ends by itself with exit status 6 or 7; its recording is complete",
    limit=4,
    unit="s",
    times=4,
)
def write_stuck(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, board.port)
    run = scene.moving(board, calls=calls)
    scene.unreceived = 1
    calls.start("delay 20000")
    until("a spoiled call", calls.calls)
    time.sleep(scene.random.uniform(0.0, 0.25))  # noqa: TID251, a random moment
    pressed = run.signal(signal.SIGINT)
    scene.ended(run, 6, 7)
    scene.figure(time.monotonic() - pressed)
    scene.verified()


@row(
    "write-error",
    "a write to the port fails once with an error: EIO, ENXIO, ENOSPC or EBADF",
    "the goal ends with a code of the hardware and exit status 6; nothing is sent afterwards",
    times=4,
)
def write_error(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, board.port)
    run = scene.moving(board, calls=calls)
    scene.unreceived = 1
    calls.start(f"errno {scene.share([5, 6, 9, 28])[0]} once")
    scene.faulted(run, "hw.port_lost")
    scene.check(len(calls.calls()) == 1, f"{len(calls.calls())} calls failed")
    scene.verified()


@row(
    "short-writes",
    "every write to the port takes at most a random number of bytes, from 1 to 19",
    "the board reads exactly the frames that were recorded, and ends where the task ends",
    times=4,
)
def short_writes(scene: Scene) -> None:
    board = scene.board()
    calls = WrongCalls(scene.folder, board.port)
    calls.start(f"short {scene.random.randint(1, 19)}")
    run = scene.run("21", board=board, environment=calls.environment)
    scene.ended(run, 0)
    sent = len(run.events("sent"))
    scene.check(len(calls.calls()) > sent, f"{len(calls.calls())} calls for {sent} frames")
    state = board.ask("state")
    scene.check(state["lost"] == state["wrong"] == 0, f"the board lost bytes: {state}")
    scene.check(state["angles"] == [90, 90, 90, 0], f"it ends at {state['angles']}")
    scene.verified()
