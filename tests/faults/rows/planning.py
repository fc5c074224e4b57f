"""Planners lie, die, hang, or are starved of memory."""

import functools
import itertools
import json
import os
import resource
import signal
import sys
import time
from pathlib import Path

from tests.faults.board import Board
from tests.faults.machine import measured
from tests.faults.process import Server, kill, until
from tests.faults.row import Scene, last_line, row
from tests.faults.rows.files import used
from tests.support.paths import ROBOT_FILE

PRELOAD = Path(__file__).parents[1] / "means" / "preload" / "planner"


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
    "elsewhere",
)


@row(
    "planner-lies",
    "a planner answers with another plan: other shapes, joints, limits, start, goal, duration; or"
    " with joint positions that bring the tool elsewhere",
    "the goal ends `plan.worker_died` with what is wrong; no frame is sent; the next goal succeeds",
    times=5,
)
def planner_lies(scene: Scene) -> None:
    board = scene.board()
    fault = scene.folder / "fault"
    environment = {"PYTHONPATH": str(PRELOAD), "PLANNER_FAULT": str(fault)}
    server = scene.serve("--activate", board=board, environment=environment)
    kinds = scene.share(LIES)
    scene.injections = len(kinds)
    for kind in kinds:
        before = len(board.frames())
        fault.write_text(kind)
        result = server.result(server.goal(28 if kind == "elsewhere" else 21))
        scene.check(not fault.exists(), f"{kind}: the planner was not asked")
        code, message = result["code"], result["message"]
        scene.check(code == "plan.worker_died", f"{kind}: the code is {code}: {message}")
        scene.check("answered" in message, f"{kind}: the message is {message}")
        scene.check(len(board.frames()) == before, f"{kind}: frames were sent")
        scene.succeeds(server, f"after {kind}")


DEATHS = ("exits", "raises", "hangs", "SIGKILL", "SIGSEGV", "SIGABRT")
PATIENCE = 5.0  # a motion must be planned in this time [s]


@row(
    "planner-dies",
    "a planner process, while it plans, ends, raises an exception, is killed (SIGKILL, SIGSEGV,"
    " SIGABRT), or does not answer",
    "the goal ends `plan.worker_died`, or after its 5 s `plan.timeout`, and nothing is sent; the"
    " figure is the time beyond that, and until the next goal moves the arm",
    limit=2,  # on two cores, beside two other rows that compute
    unit="s",
    times=6,
)
def planner_dies(scene: Scene) -> None:
    board = scene.board()
    fault = scene.folder / "fault"
    environment = {"PYTHONPATH": str(PRELOAD), "PLANNER_FAULT": str(fault)}
    server = scene.serve("--activate", board=board, environment=environment)
    for kind in scene.share(DEATHS):
        before, begin = len(board.frames()), time.monotonic()
        fault.write_text(kind)
        result = server.result(server.goal(21))
        scene.check(not fault.exists(), f"{kind}: the planner was not asked")
        code = "plan.timeout" if kind == "hangs" else "plan.worker_died"
        scene.check(result["code"] == code, f"{kind}: {result['code']}: {result['message']}")
        scene.check(len(board.frames()) == before, f"{kind}: frames were sent")
        scene.figure(time.monotonic() - begin - (PATIENCE if kind == "hangs" else 0.0))
        moves_again(scene, server, board, f"after {kind}")


def moves_again(scene: Scene, server: Server, board: Board, what: str) -> None:
    """Run a task; the figure is how long it takes to the first frame."""
    before, begin = len(board.frames()), time.monotonic()
    goal = server.goal(21)
    result = server.result(goal)
    if moved := board.frames()[before:]:
        scene.figure(moved[0].time - begin)
    scene.check(result["code"] == "ok", f"{what}: {result['code']}: {result['message']}")


@row(
    "slow-joint",
    "a robot file with a velocity or an acceleration of 1e-7 or less",
    "the goal ends `plan.too_long` with exit status 5, no frame is sent, and the memory of each"
    " process stays bounded",
    limit=300,
    unit="MiB",
    times=4,
    quick=1,
)
def slow_joint(scene: Scene) -> None:
    ((text, value),) = scene.share(
        itertools.product(("velocity = 1.0", "acceleration = 0.5"), ("1e-7", "2e-8"))
    )
    scene.robot({text: f"{text.partition(' ')[0]} = {value}"})
    run = scene.run("20", board=scene.board())
    seen = list[float]()

    def ended() -> bool:
        seen.append(run.most_memory())
        return run.popen.poll() is not None

    until("its end", ended)
    scene.figure(max(seen))  # a 99th percentile of all would hide a short peak
    (result,) = run.events("result")
    scene.ended(run, 5)
    scene.check(result["code"] == "plan.too_long", f"{result['code']}: {result['message']}")
    scene.check("the limit is 600 s" in result["message"], f"the message is {result['message']}")
    scene.check(not run.events("sent"), "frames were sent")


@row(
    "planner-memory",
    "a hard limit of the address space between 0.2 and 5 GiB",
    "from 1 GiB a task runs; below, it ends at once with exit status 3 and says what is needed",
    times=4,
)
def planner_memory(scene: Scene) -> None:
    needed, board = 2**30, scene.board()
    (low,) = scene.share([True, False])
    bounds = (needed // 5, needed - 2**20) if low else (needed, 5 * needed)
    limit = scene.random.randint(*bounds)
    run = scene.run("21", board=board, limits={resource.RLIMIT_AS: limit})
    status = run.wait()
    if not low:
        scene.check(status == 0, f"{limit} bytes: exit status {status}: {last_line(run)}")
        return
    scene.check(status == 3, f"{limit} bytes: exit status {status}, not 3")
    scene.check("[plan.memory]" in run.text(), f"{limit} bytes: {last_line(run)}")
    scene.check("needs 1048576" in run.text(), f"it does not name what is needed: {run.text()}")
    scene.check(not board.reads(), "the board was opened")


# Limits, each with its option of `ulimit`: files, data [bytes], and the size of a file [bytes].
LIMITS = {
    "-n": (resource.RLIMIT_NOFILE, range(10, 24)),
    "-d": (resource.RLIMIT_DATA, range(10**8, 5 * 10**8)),
    "-f": (resource.RLIMIT_FSIZE, range(1, 60_000)),
}


@row(
    "host-limits",
    "too low a limit of data or of the size of a file for `run` and `plan`, or of open files for "
    "`run`",
    "exit status 3, or 10 if only the recording is incomplete; the error names the option of "
    "`ulimit`, and no cable, disk or bug",
    times=6,
)
def host_limits(scene: Scene) -> None:
    cases = [(name, words) for name in LIMITS for words in ("run", "plan")]
    for option, words in scene.share(case for case in cases if case != ("-n", "plan")):
        which, values = LIMITS[option]
        limits = {which: scene.random.choice(values)}
        if words == "run":
            board = scene.board()
            command = scene.armtree("run", "1", "--port", board.port, limits=limits)
        else:
            command = scene.armtree("plan", "folded", limits=limits)
        what = f"{words} with {option} {limits[which]}"
        scene.ended(command, 10 if (option, words) == ("-f", "run") else 3, what=what)
        said = command.text()
        scene.check(f"`ulimit {option}" in said, f"{what}: {said}")
        wrong = [each for each in ("bug", "cable", "disk", "room", "driver") if each in said]
        scene.check(not wrong, f"{what}: it says {wrong}: {said}")


@row(
    "planner-stopped",
    "stop or kill the planner process, or the process from which planners are forked (SIGSTOP,"
    " SIGKILL, SIGABRT, SIGSEGV), at a random moment",
    "at most the goal that needs it fails, with `plan.timeout` or `plan.worker_died`; not the next,"
    " and the figure is how long that takes to move the arm",
    limit=1,
    unit="s",
    times=3,
)
def planner_stopped(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    kinds = ("SIGSTOP", "SIGSTOP", scene.random.choice(["SIGKILL", "SIGABRT", "SIGSEGV"]))
    scene.injections = len(kinds)
    for kind in kinds:
        moment = scene.random.choice(["idle", "planning or moving"])
        goal = server.goal(21)
        if moment == "idle":
            server.result(goal)
        else:
            time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
        found = scene.random.choice([planner_at_work, fork_server])
        planner = until("a planner", functools.partial(found, server))
        os.kill(planner, signal.Signals[kind])
        if kind == "SIGSTOP":  # each of its threads stops when it is scheduled
            until("its stop", functools.partial(stopped, planner))
        else:
            until("its end", functools.partial(ended, planner))
        code = server.result(goal)["code"]
        may = ["ok", "plan.worker_died"]  # the second also if it is stopped while it starts
        may += ["plan.timeout"] if kind == "SIGSTOP" else []
        scene.check(code in may, f"{kind}, {moment}: the goal ends {code}")
        moves_again(scene, server, board, f"after {kind}, {moment}")
        if found is fork_server:  # not needed meanwhile, so it is still there
            kill(planner, signal.SIGCONT)
        else:
            left = Path(f"/proc/{planner}").exists()
            scene.check(not left, f"{kind}, {moment}: it still exists")


def planner_at_work(server: Server) -> int:
    """The planner process that gets requests; 0 if it was not forked yet."""
    _, *workers = planners(server) or [0]
    return workers[-1] if workers else 0


def fork_server(server: Server) -> int:
    """The process from which planners are forked; 0 if it has not started."""
    return next(iter(planners(server)), 0)


def planners(server: Server) -> list[int]:
    """The fork server of the planners, and its workers, in the order of their starts."""
    found = [pid for pid in server.family() if "worker_main" in command_line(pid)]
    return sorted(found, key=lambda pid: int(status(pid)[19]))


def stopped(pid: int) -> bool:
    return status(pid)[0] == "T"


def ended(pid: int) -> bool:
    try:
        return status(pid)[0] in "ZX"  # before that, its parent finds it alive
    except OSError:  # its parent has read its exit status
        return True


def status(pid: int) -> list[str]:
    """Fields of its stat line, beginning with the third: its state."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def command_line(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:  # it ended meanwhile
        return ""


REFUSED_S = 1.5  # for a scene that is too large; up to two thirds are the start of the command


@row(
    "huge-scenes",
    "an obstacle file of 500 to 6000 bodies, or a URDF of 500 to 6000 links",
    "up to 900 a motion is planned, or on a busy machine ends `plan.timeout`; above 1000 the"
    f" command ends with 3 and names the limit, after {REFUSED_S:g} s of processor time or less",
    limit=8,  # a planner has 5 s
    unit="s",
    times=4,
    alone=True,  # it computes all the time, and other rows would take half of that
)
def huge_scenes(scene: Scene) -> None:
    ((bodies, few),) = scene.share(itertools.product((True, False), repeat=2))
    count = scene.random.randint(500, 900) if few else scene.random.randint(1001, 6000)
    arguments = world_of(scene, count) if bodies else robot_of(scene, count)
    busy = measured().slowdown > 2.0  # other programs take most of the planner's 5 s
    plan = scene.armtree("plan", "joint_1=0.5", *arguments)
    use, status = used(plan), plan.wait()
    scene.figure(use.seconds)
    if few:
        late = busy and "No plan within 5 s" in plan.text()
        scene.check(status == 0 or late, f"{count}: exit status {status}: {last_line(plan)}")
    else:
        scene.check(status == 3, f"{count}: exit status {status}, not 3: {last_line(plan)}")
        limits = "the limit is 1000", "larger than 1048576 bytes"  # the file of 4,800 links is
        scene.check(any(limit in plan.text() for limit in limits), f"{count}: {last_line(plan)}")
        scene.check(use.processor < REFUSED_S, f"{count}: {use.processor:.2f} s of processor time")


def world_of(scene: Scene, count: int) -> list[str | Path]:
    """An obstacle file with many bodies."""
    places = [[0.3 + 0.01 * (i % 50), 0.01 * (i // 50), 0.2] for i in range(count)]
    world = [
        {"name": f"b{i}", "box": {"size": [0.005] * 3}, "position": place}
        for i, place in enumerate(places)
    ]
    path = scene.folder / "world.json"
    path.write_text(json.dumps(world))
    return ["--world", path]


def robot_of(scene: Scene, count: int) -> list[str | Path]:
    """The shipped robot with many links on its base."""
    urdf = ROBOT_FILE.with_suffix(".urdf").read_text()
    shape = '<collision><geometry><box size="0.002 0.002 0.002"/></geometry></collision>'
    more = "".join(
        f'<link name="m{i}">{shape}</link><joint name="m{i}" type="fixed">'
        f'<parent link="base_link"/><child link="m{i}"/><origin xyz="0.3 0 0.3"/></joint>'
        for i in range(count)
    )
    path = scene.folder / "arm.urdf"
    path.write_text(urdf.replace("</robot>", f"{more}</robot>"))
    return ["--robot", scene.robot({f'"{ROBOT_FILE.with_suffix(".urdf")}"': f'"{path}"'})]


BESIDE = """task: {number}
name: beside_{number}
description: Move closely past a box, and back.
tree:
  sequence:
    - subtree: move_joints
      with: {{joints: {{joint_1: 0.0, joint_2: 0.0, joint_3: 0.0}}}}
    - AddBox: {{body: box_{number}, size: [24.7 mm, 75.5 mm, 42.3 mm], position: {place}}}
    - subtree: move_joints
      with: {{joints: {{joint_1: 1.441, joint_2: -1.218, joint_3: 1.329}}}}
    - RemoveBody: {{body: box_{number}}}
"""


@row(
    "beside-obstacles",
    "motions whose straight path passes a box closely, so that frames of whole degrees come too"
    " near; the box is 2 mm around such a place",
    "the planner takes a wider path: no goal ends `plan.motion_collides`, and all are done",
    times=2,
)
def beside_obstacles(scene: Scene) -> None:
    numbers = range(30, 33)
    for number in numbers:
        place = [-100.4, 155.9, 90.4]
        if number > 30:
            place = [round(each + scene.random.uniform(-2.0, 2.0), 1) for each in place]
        words = "[" + ", ".join(f"{each} mm" for each in place) + "]"
        text = BESIDE.format(number=number, place=words)
        scene.write({f"trees/{number}_beside_{number}.yaml": text})
    run = scene.run(*map(str, numbers), board=scene.board())
    scene.ended(run, 0)
    codes = [each["code"] for each in run.events("result")]
    scene.check(codes == ["ok"] * len(numbers), f"the goals end {codes}")
    scene.injections = len(numbers)
    scene.verified()


HAND_BUILT = """
import threading
from hardware import RealClock, load_robot
from skills.motion import Pool, Query
pool, done, answers = Pool(load_robot(), 1, RealClock()), threading.Semaphore(0), []
pool.start()
good = dict(group="arm", start=(0.0,) * 4, goal=(0.1,) * 3)
bad = [dict(world=None), dict(via=None), dict(goal=None), dict(start="abcd"), dict(group=None)]
for change in (*bad, dict(seed=None), dict(timeout=None), dict(spare=None), {}):
    pool.submit(Query(**{**good, **change}), lambda each: (answers.append(each), done.release()))
    done.acquire()
pool.close()
print(*(getattr(each, "code", type(each).__name__) for each in answers))
"""


@row(
    "hand-built-queries",
    "a Python program builds queries with `None` as world, start, goal, group, seed or timeout",
    "each is answered with `plan.bad_query`, and the planner process answers the next one",
    times=1,
)
def hand_built_queries(scene: Scene) -> None:
    program = scene.armtree("-c", HAND_BUILT, argv=[sys.executable])
    scene.ended(program, 0)
    found, wanted = program.output.read_text().split(), ["plan.bad_query"] * 8 + ["Plan"]
    scene.check(found == wanted, f"the answers are {found}")
    scene.injections = len(wanted)
