"""The computer is busy, freezes the command, or turns its clock; skills and drivers are wrong."""

import contextlib
import itertools
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from tests.faults.board import Board
from tests.faults.means.wrong_calls import WallClock
from tests.faults.process import ARMTREE, Command, Server, kill, until
from tests.faults.row import Scene, delays, frames_of, last_line, motions_of, row
from tests.faults.rows.command_line import ENDED_S

WRITTEN = re.compile(r"^wchar: (\d+)", re.MULTILINE)
PERIOD = 0.1  # between two frames to the published sketch [s]


def timed(run: Command) -> list[dict[str, Any]]:
    """The frames of the motions of a run."""
    return [each for each in run.events("sent") if each["scheduled_s"] is not None]


def shifts(
    times: Sequence[float], motions: Sequence[Sequence[float]]
) -> Iterator[tuple[float, float]]:
    """By how much each frame makes up for the latest one before it, and is later than the last [s].

    A frame that is up to one period late does not delay those after it, a later one does. So no
    frame makes up for more than a period; one that does was sent in a burst.

    Args:
        times: As of `delays`.
        motions: As of `delays`.
    """
    for late in delays(times, motions):
        for number, most in enumerate(itertools.accumulate(late, max)):
            yield most - late[number], late[number] - late[max(0, number - 1)]


def read_shifts(scene: Scene, run: Command, board: Board) -> Iterator[tuple[float, float]]:
    """The shifts of the frames of a run, by the log of its board."""
    sent, read = run.events("sent"), board.frames()
    scene.check(len(read) == len(sent), f"the board has read {len(read)} of {len(sent)} frames")
    pairs = zip(read, sent, strict=False)
    times = [frame.time for frame, each in pairs if each["scheduled_s"] is not None]
    return shifts(times, [each["times"] for each in run.events("schedule")])


def no_burst(scene: Scene, times: Sequence[float], motions: Sequence[Sequence[float]]) -> None:
    """Check the times at which frames were sent; a board that is as starved reads them later."""
    for number, (gain, _) in enumerate(shifts(times, motions)):
        scene.check(gain < 1.1 * PERIOD, f"a burst: frame {number} makes up for {gain:.3f} s")


@row(
    "clock",
    "the wall clock jumps by up to a day, forwards and backwards, during a motion",
    "the motion continues without a pause or a burst; the recording keeps its order and verifies",
    limit=100,  # a period, by the log of the board
    unit="ms",
    times=4,
)
def clock(scene: Scene) -> None:
    board = scene.board()
    wall = WallClock(scene.folder)
    wall.turn(-86400)
    run = scene.run("20", board=board, environment=wall.environment)
    for _ in range(4):
        run.until_event("sent", len(run.events("sent")) + scene.random.randint(1, 5))
        wall.turn(scene.random.choice([-86400, -3600, -1, 1, 3600, 86400]))
    run.until_event("sent", len(run.events("sent")) + 3)
    run.signal(signal.SIGINT)
    scene.ended(run, 7)
    for gain, loss in read_shifts(scene, run, board):
        scene.figure(1000 * max(gain, loss))
    yesterday = f"{datetime.now(UTC) - timedelta(days=1):%Y%m%d}"
    (recording,) = scene.recordings()
    scene.check(recording.name.startswith(yesterday), f"it did not see the clock: {recording.name}")
    scene.verified()


@row(
    "starved",
    "24 to 32 busy loops on all cores, from the first motion on of a run with `nice -n 19`",
    "the tasks are done; late frames move the rest, and none are sent in a burst",
    times=3,
    alone=True,
)
def starved(scene: Scene) -> None:
    board = scene.board()
    polite = "nice", "-n19", ARMTREE  # it asks for no higher priority then
    run = scene.run("21", "21", board=board, argv=polite)
    run.until_event("sent", scene.random.randint(1, 8))
    with busy_loops(scene.random.randint(24, 32)):
        run.until_event("result", 2)
    scene.ended(run, 0)
    motions = [each["times"] for each in run.events("schedule")]
    no_burst(scene, [each["time_s"] for each in timed(run)], motions)
    late = [each["time_s"] - each["scheduled_s"] for each in timed(run)]
    scene.check(max(late) > 0.01, f"no frame was late: at most {1000 * max(late):.1f} ms")
    scene.check(board.ask("state")["lost"] == 0, "the board lost bytes")
    scene.verified()


@row(
    "busy-host",
    "2 to 6 busy loops of normal priority beside a server of normal priority, with three goals in"
    " its queue; again and again 16 more, on one processor, keep the thread that records from"
    " running for up to 1.5 s",
    "frames wait until the earlier ones are recorded, and the log names the busy computer; all"
    " three goals are done, and the arm stays active; nothing is sent in a burst",
    times=2,
    alone=True,
)
def busy_host(scene: Scene) -> None:
    board = scene.board()
    polite = "nice", "-n1", ARMTREE  # it asks for no higher priority then
    server = scene.serve("--activate", "--policy", "queue", board=board, argv=polite)
    for _ in range(5):  # the scheduler often lets the thread run; most times, once is enough
        starve_recorder(scene, server, board)
        late = [line for line in server.text().splitlines() if "A frame waited" in line]
        if late:
            break
    named = [line for line in late if "the computer is busy" in line]
    scene.check(named, f"no frame waited for a recorder without processor time: {late}")
    scene.check(server.state() == "active", f"then the arm is {server.state()}")
    for path in scene.recordings():
        no_burst(scene, [each.time for each in frames_of(path)], motions_of(path))
    scene.check(board.ask("state")["lost"] == 0, "the board lost bytes")
    server.signal(signal.SIGINT)
    scene.ended(server, 0)
    scene.verified()


def starve_recorder(scene: Scene, server: Server, board: Board) -> None:
    """Starve the thread that records again and again, until three goals are done."""
    goals = [server.goal(21) for _ in range(3)]
    count = len(board.frames()) + scene.random.randint(1, 8)
    until("the arm moves", lambda: len(board.frames()) >= count)
    recorder = busiest_writer(server)
    with busy_loops(scene.random.randint(2, 6)):
        while server.get(f"/api/goals/{goals[-1]}")["state"] in ("ACCEPTED", "EXECUTING"):
            with starved_thread(recorder):
                time.sleep(scene.random.uniform(0.5, 1.5))  # noqa: TID251, so long it is starved
            time.sleep(0.3)  # noqa: TID251, then it has time to record what waits
        for goal in goals:
            result = server.result(goal)
            scene.check(result["code"] == "ok", f"a goal ends {result['code']}: {result}")


def busiest_writer(command: Command) -> int:
    """The thread of a command in motion that writes most: the one that records."""

    def written() -> dict[int, int]:
        tasks = Path(f"/proc/{command.pid}/task").iterdir()
        return {
            int(task.name): int(WRITTEN.findall((task / "io").read_text())[0]) for task in tasks
        }

    before = written()
    time.sleep(0.5)  # noqa: TID251, meanwhile frames are recorded
    return max(before, key=lambda thread: written().get(thread, 0) - before[thread])


@contextlib.contextmanager
def starved_thread(thread: int) -> Iterator[None]:
    """Give a thread hardly any processor time: only what busy loops on its processor leave."""
    allowed = os.sched_getaffinity(thread)
    core = {min(allowed)}
    with busy_loops(16, core):
        os.sched_setaffinity(thread, core)
        os.sched_setscheduler(thread, os.SCHED_IDLE, os.sched_param(0))
        try:
            yield
        finally:
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
            os.sched_setaffinity(thread, allowed)


@contextlib.contextmanager
def busy_loops(count: int, cores: Collection[int] = ()) -> Iterator[None]:
    """Other programs that compute, on all processors or on some."""
    loops = [
        # Linux schedules sessions, so each loop gets as much as the command.
        subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True)
        for _ in range(count)
    ]
    try:
        for loop in loops if cores else ():
            os.sched_setaffinity(loop.pid, cores)
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


@row(
    "frozen",
    "the command is stopped (SIGSTOP) for up to 2 s during a motion, then continues",
    "the rest of the motion is later, without a burst, and ends where it should: no frame makes up"
    " for more than a period",
    limit=130,  # a period, and what the board may read later
    unit="ms",
    times=4,
)
def frozen(scene: Scene) -> None:
    board = scene.board()
    run = scene.moving(board, task="21", frames=(1, 8))
    for pid in [run.pid, *run.family()]:
        kill(pid, signal.SIGSTOP)
    time.sleep(scene.random.uniform(0.1, 2.0))  # noqa: TID251, so long it is stopped
    for pid in [run.pid, *run.family()]:
        kill(pid, signal.SIGCONT)
    scene.ended(run, 0)
    for gain, _ in read_shifts(scene, run, board):
        scene.figure(1000 * gain)
    state = board.ask("state")
    scene.check(state["lost"] == state["wrong"] == 0, f"the board lost bytes: {state}")
    scene.check(state["angles"] == [90, 90, 90, 0], f"it ends at {state['angles']}")
    scene.verified()


GOALS = (1.0, 0.5, 0.4, -0.9)  # of the joints [rad]
SLOW = 0.02  # velocity of all joints in the robot file [rad/s]
SKILL = """
from dataclasses import replace

from py_trees.ports import PortInformation

from skills.leaves.execute import Execute


class Hurry(Execute):
    '''Play a motion too fast.'''

    INPUT_PORTS = {**Execute.INPUT_PORTS, "factor": PortInformation(int, description="how much")}

    def compile_motion(self, start):
        schedule, motion = super().compile_motion(start)
        factor = self.get_input("factor")
        some = schedule.setpoints[::factor]  # a period apart, as those of an honest motion
        points = tuple(replace(one, time=one.time / factor) for one in some)
        return replace(schedule, setpoints=points, duration=schedule.duration / factor), motion
"""

TASK = """
task: 30
name: hurry
description: Play a motion too fast.
tree:
  sequence:
    - SetStart: {{start: $start}}
    - Target: {{start: $start, joints: {{{joint}: {goal}}}, goal: $goal}}
    - parallel:
        - PlanArm: {{start: $start, goal: $goal, plan: $arm_plan}}
        - PlanGripper: {{start: $start, goal: $goal, plan: $gripper_plan}}
    - Hurry: {{arm_plan: $arm_plan, gripper_plan: $gripper_plan, factor: {factor}}}
"""


@row(
    "too-fast",
    "a skill plays a motion of any joint, on either firmware, at 3 to 15 times its velocity, which"
    " is 0.02 rad/s, so that the board could follow",
    "the write guard refuses it: `hw.joint_too_fast`, exit status 6; no joint gets further in 0.4 s"
    " than at its limit in 0.4 s and three periods",
    times=8,
    quick=1,
)
def too_fast(scene: Scene) -> None:
    ((firmware, joint),) = scene.share(itertools.product(("stock", "armtree"), range(4)))
    far = GOALS[joint] * scene.random.uniform(1.0, 1.4)
    factor = scene.random.randint(3, 15)  # a step is as many degrees at least
    texts = {
        "skills/hurry.py": SKILL,
        "trees/30_hurry.yaml": TASK.format(joint=f"joint_{joint + 1}", goal=far, factor=factor),
    }
    scene.write(texts)
    board = scene.board(firmware)
    scene.robot({'"stock"': f'"{firmware}"', "velocity = 1.0": f"velocity = {SLOW}"})
    run = scene.run("30", "--skills", scene.folder / "skills", board=board)
    found = run.wait(), run.events("result")[-1]["code"]
    expected = 6, "hw.joint_too_fast"
    scene.check(found == expected, f"{firmware}, joint {joint + 1}: {found}: {last_line(run)}")
    moved = [each for each in run.events("sent") if each["joints"]]
    sent = [(each["time_s"], each["positions"][joint]) for each in moved]
    period = PERIOD if firmware == "stock" else 0.02
    for begin, before in sent:
        for end, after in sent:
            if begin < end < begin + 0.4:
                # The guard accepts three periods at once, because frames may be late, 1 % and a
                # degree for rounding. It looks at the clock shortly before the time of this event.
                most = 1.01 * SLOW * (end - begin + 3 * period + 0.01) + math.radians(1.0)
                scene.check(abs(after - before) < most, f"{after - before} in {end - begin} s")


DRIVER = """
import time
from pathlib import Path

from hardware import SerialLink
from hardware.drivers.arduino.serial_servo import SerialServo


class WrongLink(SerialLink):
    calls = 0

    def {call}(self, *arguments):
        self.calls += 1
        if self.calls > {after}:
            with Path("wrong").open("a") as file:
                print(time.monotonic(), file=file)
            {how}
        return super().{call}(*arguments)


class Wrong(SerialServo):
    def link(self, joints, firmware, baud, port):
        return WrongLink(port, baud)
"""


@row(
    "wrong-driver",
    "a driver of another package raises any exception, returns nothing, or does not return",
    "the goal ends `hw.driver`, or `hw.port_stalled` if a write does not return, with exit status"
    " 6; nothing is sent afterwards, and the command ends",
    limit=400,  # the deadline of 300 of a write
    unit="ms",
    times=8,
    quick=1,
)
def wrong_driver(scene: Scene) -> None:
    scene.robot({'driver = "serial_servo"': 'driver = "wrong"'})
    board, info = scene.board(), "wrong_driver-1.0.dist-info"
    raised = ("KeyError(1)", "SystemExit", "MemoryError", "UnicodeError('\\n')")
    wrong = ["time.sleep(30)", *(f"raise {each}" for each in raised)]
    silent = ["raise ZeroDivisionError", "return b''", "return None"]
    ((call, how),) = scene.share(
        [*(("write", each) for each in wrong), *(("read", each) for each in silent)]
    )
    after = scene.random.randint(1, 12) if call == "write" else 0
    scene.write(
        {
            f"{info}/METADATA": "Metadata-Version: 2.1\nName: wrong-driver\nVersion: 1.0\n",
            f"{info}/entry_points.txt": "[armtree.hardware]\nwrong = wrong_driver:Wrong\n",
            "wrong_driver.py": DRIVER.format(call=call, how=how, after=after),
        }
    )
    scene.unreceived = 1
    run = scene.run("20", board=board, environment={"PYTHONPATH": str(scene.folder)})
    if call == "read":
        run.until_event("lifecycle", 4)
        board.ask("send something to read")
    code = "hw.port_stalled" if "sleep" in how else "hw.driver"
    failed, ended = scene.faulted(run, code), time.monotonic()
    calls = [float(each) for each in (scene.folder / "wrong").read_text().split()]
    scene.figure(1000 * (failed - calls[0]))
    scene.check(ended - failed < ENDED_S, f"{call}, {how}: it ended after {ended - failed:.1f} s")
    most = after if call == "write" else 1
    scene.check(len(board.frames()) <= most, f"{call}, {how}: {len(board.frames())} frames")


STUCK = """
import time
from pathlib import Path

from py_trees.common import Status
from skills import Skill


class Stuck(Skill):
    '''Never return, once there is a file `go`.'''

    def on_start(self):
        return self.on_running()

    def on_running(self):
        if Path("go").exists():
            Path("stuck").touch()
            time.sleep(600)
        self.context.wake_at(self.context.now() + 0.01)
        return Status.RUNNING
"""

STUCK_TASK = """
task: 31
name: stuck
description: Move, and run code that does not return.
tree:
  parallel:
    - subtree: move_joints
      with: {joints: {joint_1: 1.4}}
    - Stuck
"""


@row(
    "stuck-skill",
    "the code of a skill does not return while the arm moves; then a stop",
    "the arm stops at once; the goal ends `hw.cancel_timeout`; a stop is still answered, and new"
    " goals are refused as `server.held`; SIGTERM ends the server",
    limit=150,
    unit="ms",
    times=3,
)
def stuck_skill(scene: Scene) -> None:
    scene.write({"skills/stuck.py": STUCK, "trees/31_stuck.yaml": STUCK_TASK})
    board = scene.board()
    server = scene.serve("--activate", "--skills", scene.folder / "skills", board=board)
    goal = server.goal(31)
    count = scene.random.randint(1, 8)
    until("the arm moves", lambda: len(board.frames()) >= count)
    (scene.folder / "go").touch()
    until("the skill is stuck", (scene.folder / "stuck").exists)
    begin = time.monotonic()
    server.stop()
    result = server.result(goal)
    scene.check(result["code"] == "hw.cancel_timeout", f"the goal ends {result['code']}")
    scene.figure(1000 * (board.frames()[-1].time - begin))
    until("the fault is processed", lambda: server.state() == "unconfigured")
    scene.check(server.post("/api/goals", {"task": 31})["code"] == "server.held", "a new goal")
    server.stop()
    server.signal(signal.SIGTERM)
    scene.ended(server, 0)


STUCK_VALIDATION = """
import time
from pathlib import Path

from skills import Skill


class Stuck(Skill):
    '''Never return, once there is a file `go`.'''

    @classmethod
    def validate(cls, robot, inputs):
        if Path("go").exists():
            Path("stuck").touch()
            time.sleep(600)

    def on_start(self):
        raise RuntimeError
"""


@row(
    "stuck-validation",
    "the validation of a goal does not return, in the code of a skill; then a stop",
    "stops and cancels are still answered, and nothing moves; a second SIGTERM ends the server",
    limit=50,
    unit="ms",
    times=2,
)
def stuck_validation(scene: Scene) -> None:
    task = "task: 31\nname: stuck\ndescription: Never return.\ntree: Stuck\n"
    scene.write({"skills/stuck.py": STUCK_VALIDATION, "trees/31_stuck.yaml": task})
    board = scene.board()
    server = scene.serve("--activate", "--skills", scene.folder / "skills", board=board)
    (scene.folder / "go").touch()
    client = scene.armtree("send", "31", "--server", server.url)
    until("the validation is stuck", (scene.folder / "stuck").exists)
    for _ in range(5):
        scene.figure(1000 * server.stop())
        begin = time.monotonic()
        scene.check(server.request("POST", "/api/cancel")[0] == 200, "a cancel was refused")
        scene.figure(1000 * (time.monotonic() - begin))
    scene.check(board.data() == b"", "something was sent")
    server.signal(signal.SIGTERM)
    time.sleep(scene.random.uniform(0.6, 1.2))  # noqa: TID251, a second one counts after 0.5 s
    server.signal(signal.SIGTERM)
    scene.ended(server, 143)
    client.wait()


WAITS = """
import armtree, sys
with armtree.Client("{url}") as client:
    print("waits", flush=True)
    try:
        client.result("{goal}")
    except armtree.ServerUnreachable:
        sys.exit(13)
"""


@row(
    "frozen-server",
    "a server is stopped (SIGSTOP) while a client waits for a goal, and others ask",
    "each client ends with exit status 13: within 9 to 15 s if it requests something, 14 to 30 s if"
    " a Python program waits for a result, 29 to 46 s if it reads a stream of events",
    times=1,
    waits=True,
)
def frozen_server(scene: Scene) -> None:
    server = scene.serve("--activate")
    clients = {scene.armtree("send", "22", "--wait", "--server", server.url): (29.0, 46.0)}
    goal = until("the goal", lambda: server.get("/api/status")["goal"])["goal_id"]
    program = WAITS.format(url=server.url, goal=goal)
    waiting = scene.armtree("-c", program, argv=[sys.executable])
    clients[waiting] = 14.0, 30.0
    waiting.until_printed("waits")
    time.sleep(scene.random.uniform(0.2, 2.0))  # noqa: TID251, a random moment
    stopped = server.signal(signal.SIGSTOP)
    for name in ("status", "cancel"):
        clients[scene.armtree(name, "--server", server.url)] = 9.0, 15.0
    ended = dict[Command, float]()

    def all_ended() -> bool:
        for client in clients:
            if client not in ended and client.popen.poll() is not None:
                ended[client] = time.monotonic() - stopped
        return len(ended) == len(clients)

    until("the clients end", all_ended)
    for client, (least, most) in clients.items():
        scene.ended(client, 13)
        after = ended[client]
        limits = f"{least:g} to {most:g} s"
        scene.check(least < after < most, f"{client.words}: after {after:.1f} s, not {limits}")
    kill(server.pid, signal.SIGCONT)
    scene.check(server.stop() < 10, "it does not go on")
