"""The board sends garbage, resets, loses power, or reads other bytes than were sent."""

import time

from tests.faults.process import until
from tests.faults.row import Scene, row

# An answer may take 250 ms, counted in polls of 50 ms. The first poll may come too soon to count.
LATEST = 350


@row(
    "garbage",
    "the board sends 300 kB of random bytes during a motion",
    "the motion continues to its target, or ends `hw.frame_lost` if acknowledgements are"
    " behind the garbage; the memory of the command grows little",
    # 10 MB would take a quarter of an hour on a line of 115,200 baud, and 300 kB take 26 s. 5 MiB
    # was the aim; the command also prints and records what it reads.
    limit=10,
    unit="MiB",
    times=2,
)
def garbage(scene: Scene) -> None:
    (firmware,) = scene.share(["stock", "armtree"])
    board = scene.board(firmware)
    run = scene.moving(board, task="21", frames=(1, 3))
    before = run.memory()
    board.ask(f"garbage 300000 {scene.random.random()}")
    most = before
    while run.popen.poll() is None:
        most = max(most, run.memory() if run.popen.poll() is None else 0.0)
        time.sleep(0.02)  # noqa: TID251, it samples another process
    text = run.output.read_bytes()
    scene.check(text.count(b'"received"') > 10, "the garbage was not read")
    state = board.ask("state")
    scene.check(state["lost"] == state["wrong"] == 0, f"the board lost bytes: {state}")
    if firmware == "armtree" and run.wait() == 6:
        scene.faulted(run, "hw.frame_lost")
    else:
        scene.ended(run, 0)
        scene.check(state["angles"] == [90, 90, 90, 0], f"it ends at {state['angles']}")
    scene.figure(most - before)
    scene.verified()


@row(
    "reset",
    "the board with the firmware `armtree` resets during a motion",
    "the goal ends `hw.board_reset` or `hw.frame_lost`; nothing is sent afterwards",
    limit=350,  # the board reports it when it has booted; at the latest an answer is missing
    unit="ms",
    times=5,
)
def reset(scene: Scene) -> None:
    board = scene.board("armtree")
    run = scene.moving(board, frames=(2, 60))
    pressed = board.ask("reset")["time"]
    scene.figure(1000 * (scene.faulted(run, "hw.board_reset", "hw.frame_lost") - pressed))
    scene.verified()


@row(
    "reset-stock",
    "the board with the published sketch resets during a motion: it cannot be detected",
    "the goal ends as usual, and the recording has what was sent",
    times=2,
)
def reset_stock(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board, task="21", frames=(2, 8))
    board.ask("reset")
    scene.ended(run, 0)
    scene.verified()


@row(
    "brown-out",
    "the supply of the board of a server dips several times, during a motion and after it",
    "the goal ends with a code of the hardware; nothing is sent until a person activates the arm",
    times=3,
)
def brown_out(scene: Scene) -> None:
    board = scene.board("armtree")
    server = scene.serve("--activate", "--policy", "queue", board=board)
    goals = [server.goal(20), server.goal(21)]
    count = scene.random.randint(1, 40)
    until("the first frames", lambda: len(board.frames()) >= count)
    for _ in range(scene.random.randint(2, 5)):
        board.ask("reset")
        time.sleep(scene.random.uniform(0.0, 0.3))  # noqa: TID251, random moments
    first, second = [server.result(goal)["code"] for goal in goals]
    scene.check(first in ("hw.board_reset", "hw.frame_lost"), f"the first ends {first}")
    scene.check(second.startswith("hw."), f"the second ends {second}")
    until("the fault is processed", lambda: server.state() == "unconfigured")
    frames = len(board.frames())
    board.ask("reset")
    server.post("/api/arm/configure")
    scene.check(server.state() == "inactive", f"then the arm is {server.state()}")
    scene.check(len(board.frames()) == frames, "a frame was sent without activation")
    server.post("/api/arm/activate")
    scene.succeeds(server, "after the activation")


@row(
    "damaged-byte",
    "one bit of a byte changes between the computer and the board",
    "with the firmware `armtree`, the goal ends `hw.frame_lost`, counted from the changed byte;"
    " nothing is sent afterwards",
    limit=LATEST,
    unit="ms",
    times=5,
    quick=1,
)
def damaged_byte(scene: Scene) -> None:
    harmed(scene, f"damage {scene.random.randrange(20)}")


@row(
    "silence",
    "the board with the firmware `armtree` stops to answer during a motion",
    "the goal ends `hw.frame_lost`, counted from the first missing answer; nothing is sent"
    " afterwards",
    limit=LATEST,
    unit="ms",
    times=3,
)
def silence(scene: Scene) -> None:
    harmed(scene, "mute")


def harmed(scene: Scene, command: str) -> None:
    """Give the board a command that harms its next frame, which may be one of a later motion."""
    board = scene.board("armtree")
    run = scene.moving(board, frames=(2, 60))
    board.ask(command)
    failed = scene.faulted(run, "hw.frame_lost")
    scene.figure(1000 * (failed - board.ask("state")["harmed"]))
    scene.verified()


RANGES = {
    **dict.fromkeys(("joint_1", "joint_2", "joint_3"), (-1.57, 1.57)),
    "joint_4": (-1.57, 0.0),
}
MOVE = """    - force_success:
        subtree: move_joints
        with: {{joints: {goal}}}
"""


@row(
    "overload",
    "random motions over the whole range of all joints, on a board with the published sketch, which"
    " reads nothing while a servo turns",
    "those that are free of collisions are done; the board loses no byte, reads no wrong angle, and"
    " ends where the last frame says",
    # A thousand would take an hour; tests/hardware/arm/test_schedule.py has more in simulated time.
    times=2,
    waits=True,
)
def overload(scene: Scene) -> None:
    text = "task: 30\nname: far\ndescription: Move far.\ntree:\n  sequence:\n"
    for _ in range(8):
        goal = {name: round(scene.random.uniform(*each), 3) for name, each in RANGES.items()}
        text += MOVE.format(goal=str(goal).replace("'", ""))
    scene.write({"trees/30_far.yaml": text})
    board = scene.board()
    run = scene.run("30", "--seed", str(scene.random.randint(1, 1000)), board=board)
    scene.ended(run, 0)
    state = until("it has read all", lambda: (s := board.ask("state"))["backlog"] == 0 and s)
    scene.check(state["lost"] == state["wrong"] == 0, f"the board lost bytes: {state}")
    angles = [int(field[1:]) for field in board.frames()[-1].data.decode().split(",")[:4]]
    scene.check(state["angles"] == angles, f"it is at {state['angles']}, not at {angles}")
    scene.injections = len(run.events("schedule"))
    scene.check(scene.injections > 2, f"only {scene.injections} of 8 motions were possible")
    scene.verified()
