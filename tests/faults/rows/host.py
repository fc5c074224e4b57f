"""The computer is busy, stops the command for a while, or turns its clock; a skill is wrong."""

import signal
import subprocess
import sys
import time

from tests.faults.process import Command, kill
from tests.faults.row import Scene, last_line, row
from tests.faults.wrong_calls import WallClock

PERIOD = 0.1  # between two frames to the published sketch [s]


def no_burst(scene: Scene, run: Command) -> None:
    """Check that no frame of a motion was sent sooner after the one before than it was planned."""
    motions = run.events("schedule")
    frames = [each for each in run.events("sent") if each["scheduled_s"] is not None]
    for motion in motions:
        count = len(motion["times"])
        sent, frames = frames[:count], frames[count:]
        planned = zip(motion["times"], motion["times"][1:], strict=False)
        pairs = zip(sent, sent[1:], planned, strict=False)
        for before, after, (first, second) in pairs:
            gap = after["time_s"] - before["time_s"]
            # A frame up to one period late does not delay the next one.
            scene.check(gap > second - first - 1.1 * PERIOD, f"a frame came {gap:.3f} s after")
            scene.check(gap > 0.005, f"a burst: {1000 * gap:.1f} ms between two frames")


@row(
    "clock",
    "the wall clock jumps by up to a day, forwards and backwards, during a motion",
    "the motion goes on without a pause or a burst; the recording keeps its order and verifies",
    limit=100,
    unit="ms",
    times=4,
)
def clock(scene: Scene) -> None:
    board = scene.board()
    wall = WallClock(scene.folder)
    wall.turn(0)
    run = scene.run("20", board=board, environment=wall.environment)
    for _ in range(4):
        run.until_event("sent", len(run.events("sent")) + scene.random.randint(1, 5))
        wall.turn(scene.random.choice([-86400, -3600, -1, 1, 3600, 86400]))
    run.until_event("sent", len(run.events("sent")) + 3)
    run.signal(signal.SIGINT)
    scene.check(run.wait() == 7, f"exit status {run.wait()}: {last_line(run)}")
    no_burst(scene, run)
    for each in run.events("sent"):
        if each["scheduled_s"] is not None:
            scene.figure(1000 * (each["time_s"] - each["scheduled_s"]))
    scene.verified()


@row(
    "starved",
    "2 to 6 busy loops on all cores, while a task runs",
    "the task is done; late frames move the rest, and none are sent in a burst",
    times=4,
    alone=True,
)
def starved(scene: Scene) -> None:
    board = scene.board()
    loops = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(scene.random.randint(2, 6))
    ]
    try:
        run = scene.run("21", board=board)
        scene.check(run.wait() == 0, f"exit status {run.wait()}: {last_line(run)}")
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    no_burst(scene, run)
    scene.check(board.ask("state")["lost"] == 0, "the board lost bytes")
    scene.verified()


@row(
    "frozen",
    "the command is stopped (SIGSTOP) for up to 2 s during a motion, then goes on",
    "the rest of the motion is later, without a burst, and ends where it should",
    times=4,
)
def frozen(scene: Scene) -> None:
    board = scene.board()
    run = scene.run("21", board=board)
    run.until_event("sent", scene.random.randint(1, 8))
    for pid in [run.pid, *run.family()]:
        kill(pid, signal.SIGSTOP)
    time.sleep(scene.random.uniform(0.1, 2.0))  # noqa: TID251, so long it is stopped
    for pid in [run.pid, *run.family()]:
        kill(pid, signal.SIGCONT)
    scene.check(run.wait() == 0, f"exit status {run.wait()}: {last_line(run)}")
    no_burst(scene, run)
    state = board.ask("state")
    scene.check(state["lost"] == state["wrong"] == 0, f"the board lost bytes: {state}")
    scene.check(state["angles"] == [90, 90, 90, 0], f"it ends at {state['angles']}")
    scene.verified()


SKILL = """
from dataclasses import replace

from py_trees.ports import PortInformation

from skills.leaves.execute import Execute


class Hurry(Execute):
    '''Play a motion too fast.'''

    INPUT_PORTS = {**Execute.INPUT_PORTS, "factor": PortInformation(float, description="how much")}

    def compile_motion(self, start):
        schedule, motion = super().compile_motion(start)
        factor = self.get_input("factor")
        points = tuple(replace(one, time=one.time / factor) for one in schedule.setpoints)
        return replace(schedule, setpoints=points, duration=schedule.duration / factor), motion
"""

TASK = """
task: 30
name: hurry
description: Play a motion too fast.
tree:
  sequence:
    - SetStart: {{start: $start}}
    - Target: {{start: $start, joints: {{joint_1: {goal}}}, goal: $goal}}
    - parallel:
        - PlanArm: {{start: $start, goal: $goal, plan: $arm_plan}}
        - PlanGripper: {{start: $start, goal: $goal, plan: $gripper_plan}}
    - Hurry: {{arm_plan: $arm_plan, gripper_plan: $gripper_plan, factor: {factor}}}
"""


@row(
    "too-fast",
    "a skill plays a motion at 3 to 20 times the velocity for which it was planned",
    "the write guard refuses it: exit status 6; no joint gets 20 % above its limit in 0.4 s",
    times=4,
    quick=1,
)
def too_fast(scene: Scene) -> None:
    for name, text in (("skills/hurry.py", SKILL), ("trees/30_hurry.yaml", TASK)):
        goal = scene.random.choice([-1, 1]) * scene.random.uniform(1.0, 1.4)
        factor = scene.random.uniform(3.0, 20.0)
        path = scene.folder / name
        path.parent.mkdir()
        path.write_text(text.format(goal=goal, factor=factor) if "{goal}" in text else text)
    scene.robot({'firmware = "stock"': 'firmware = "armtree"'})
    run = scene.run("30", "--skills", scene.folder / "skills", board=scene.board("armtree"))
    scene.check(run.wait() == 6, f"exit status {run.wait()}: {last_line(run)}")
    (result,) = run.events("result")
    codes = ("hw.joint_too_fast", "hw.too_fast")
    scene.check(result["code"] in codes, f"the code is {result['code']}")
    sent = [(each["time_s"], each["positions"][0]) for each in run.events("sent") if each["joints"]]
    for begin, before in sent:
        for end, after in sent:
            if begin < end < begin + 0.4:
                # The guard accepts three periods of 20 ms at once, because frames may be late.
                most = 1.2 * (end - begin + 0.06) * 1.0
                scene.check(abs(after - before) < most, f"{after - before} in {end - begin} s")
