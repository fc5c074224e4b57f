"""Wrong numbers, targets at the limits, cancels at any time and in storms, many goals."""

import itertools
import json
import math
import re
import signal
import socket
import threading
import time
from contextlib import ExitStack

from tests.faults.board import Board
from tests.faults.process import Server, until
from tests.faults.row import Scene, row

TURN = """task: 30
name: turn
description: Turn one joint to an angle.
parameters:
  angle: {type: angle}
tree:
  sequence:
    - subtree: move_joints
      with: {joints: {joint_1: $angle}}
"""
LIMIT = 1.570796326795  # of joint 1, in both directions [rad]


def turning(scene: Scene) -> tuple[Board, Server]:
    """A board, and a server whose task 30 turns joint 1 to `angle`."""
    scene.write({"trees/30_turn.yaml": TURN})
    board = scene.board()
    return board, scene.serve("--activate", "--result-timeout", "-1", board=board)


def wrong_number(scene: Scene) -> str:
    """JSON of something that is not an angle within the limits."""
    numbers = scene.random
    return numbers.choice(
        [
            *(
                "NaN",
                "Infinity",
                "-Infinity",
                "1e400",
                "-1e400",
                '"nan"',
                '"inf rad"',
                '"1e999 deg"',
            ),
            *("true", "false", "null", "[]", "{}", "[0.1]", '{"rad": 1}', '""', '"abc"'),
            *(
                '"1 m"',
                '"0.1.2"',
                '"१"',
                '"1_0"',
                '"--1"',
                '"1,5"',
                "00.5",
                ".5",
                "'0.5'",
                "1" * 5000,
            ),
            "1" * numbers.randint(2, 300),
            json.dumps(numbers.choice([-1, 1]) * numbers.uniform(LIMIT + 1e-9, 1e6)),
            json.dumps(numbers.choice([-1, 1]) * 10.0 ** numbers.randint(1, 300)),
            json.dumps(f"{numbers.uniform(91, 1e5)} deg"),
            json.dumps("".join(chr(numbers.randint(1, 0x2FFF)) for _ in range(8))),
        ]
    )


@row(
    "wrong-numbers",
    "200 goals with NaN, infinity, other types, huge or damaged numbers, or beyond the limits",
    "each is refused, or ends with a code of a wrong goal; not a byte is sent to the board",
    times=2,
)
def wrong_numbers(scene: Scene) -> None:
    board, server = turning(scene)
    for _ in range(200):
        value = wrong_number(scene)
        body = f'{{"task": 30, "arguments": {{"angle": {value}}}}}'.encode()
        status, answer = server.request("POST", "/api/goals", body)
        shown = value[:60]
        if scene.check(status in (201, 400, 409, 413, 422), f"{shown}: status {status}: {answer}"):
            result = server.result(answer["goal_id"]) if status == 201 else answer
            wrong = result["code"].startswith(("goal.", "request."))
            scene.check(wrong, f"{shown}: {result['code']}: {result['message'][:80]}")
    scene.injections = 200
    scene.check(board.data() == b"", f"the board has read {board.data()!r}")


@row(
    "limits",
    "a target at a limit of its joint, and one that is the next number beyond it",
    "the first is accepted and moves the arm, the second is refused with `goal.out_of_bounds`",
    times=2,
)
def limits(scene: Scene) -> None:
    board, server = turning(scene)
    (limit,) = scene.share([-LIMIT, LIMIT])
    beyond = math.nextafter(limit, math.inf * limit)
    result = server.result(server.goal(30, arguments={"angle": beyond}))
    scene.check(result["code"] == "goal.out_of_bounds", f"beyond: {result['code']}")
    scene.check(board.data() == b"", "it moved")
    goal = server.goal(30, arguments={"angle": limit})
    until("the first frames", lambda: len(board.frames()) > 2)
    server.stop()
    result = server.result(goal)
    scene.check(result["state"] == "CANCELED", f"at the limit: {result['code']}")


def cancel(scene: Scene, server: Server, goal: str) -> str:
    """Cancel a goal in a random way; return which."""
    way = scene.random.choice(["stop", "cancel", "cancel all", "cancel with time", "deactivate"])
    if way == "stop":
        server.stop()
    elif way == "deactivate":
        server.post("/api/arm/deactivate")
    elif way == "cancel all":
        server.post("/api/cancel")
    elif way == "cancel":
        server.post(f"/api/goals/{goal}/cancel")
    else:
        server.post("/api/cancel", {"stamp_ns": time.time_ns()})
    return way


@row(
    "cancel",
    "cancel a shipped task at a random time, by one of five requests",
    "the goal ends CANCELED or as it would have ended; after the hold frame nothing is sent",
    limit=150,
    unit="ms",
    times=3,
    quick=1,
)
def cancel_anywhere(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    for _ in range(4):
        if server.state() == "inactive":
            server.post("/api/arm/activate")
        goal = server.goal(scene.random.choice([0, 1, 2, 20]))
        time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
        asked = time.monotonic()
        way = cancel(scene, server, goal)
        result = server.result(goal)
        canceled = result["state"] == "CANCELED" or result["code"] in (
            "ok",
            "hw.stopped",
            "hw.not_active",
        )
        scene.check(canceled, f"{way}: {result['state']}: {result['message']}")
        time.sleep(0.5)  # noqa: TID251, so long the board looks for more
        late = [frame for frame in board.frames() if frame.time > asked]
        scene.figure(1000 * (late[-1].time - asked) if late else 0.0)
    scene.injections = 4


@row(
    "cancel-storm",
    "cancels of everything and stops, from 8 threads at once, 5,000 in total, during a motion",
    "a client that watches sees one end of the goal, CANCELED; the last byte comes within a period"
    " of the first cancel",
    limit=100,
    unit="ms",
    times=2,
)
def cancel_storm(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    watch = scene.armtree("watch", "--json", "--server", server.url)
    until("it watches", lambda: watchers(server) == 1)
    goal = server.goal(20)
    until("the first frame", board.frames)
    time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
    failed: list[str] = []

    def storm(path: str) -> None:
        for _ in range(5000 // 8):
            status, answer = server.request("POST", path)
            if status != 200:
                failed.append(f"{path}: {status} {answer}")

    paths = ["/api/stop", "/api/cancel", f"/api/goals/{goal}/cancel", "/api/stop"] * 2
    threads = [threading.Thread(target=storm, args=(path,)) for path in paths]
    begin = time.monotonic()
    for thread in threads:
        thread.start()
    result = server.result(goal)
    scene.check(result["state"] == "CANCELED", f"it ended {result['state']}")
    for thread in threads:
        thread.join()
    scene.check(not failed, f"{len(failed)} failed, such as {failed[:1]}")
    scene.figure(1000 * (board.frames()[-1].time - begin))
    scene.check(server.state() == "active", f"the arm is {server.state()}")
    scene.succeeds(server, "the next goal")
    ends = [each["state"] for each in watch.events("result") if each["task"] == 20]
    scene.check(ends == ["CANCELED"], f"it ended {ends}")
    scene.injections = 5000


@row(
    "dead-client",
    "the client of a goal sent with `--deadman` is killed or stopped; another is just killed",
    "the goal of the first is canceled, that of the second continues",
    limit=2.5,
    unit="s",
    times=4,
)
def dead_client(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    kinds = itertools.product((["--deadman"], ["--wait"]), (signal.SIGKILL, signal.SIGSTOP))
    ((deadman, number),) = scene.share(kinds)
    client = scene.armtree("send", "20", *deadman, "--server", server.url)
    until("the first frame", board.frames)
    time.sleep(scene.random.uniform(0.0, 1.0))  # noqa: TID251, a random moment
    killed = client.signal(number)
    if deadman == ["--deadman"]:
        until("no goal is left", lambda: server.get("/api/status")["goal"] is None)
        scene.figure(max(0.0, board.frames()[-1].time - killed))
    else:
        count = len(board.frames())
        until("more frames", lambda: len(board.frames()) > count + 15)
        server.stop()
    goals = server.get("/api/goals")["goals"]
    scene.check([each["state"] for each in goals] == ["CANCELED"], f"the goals: {goals}")


CHATTER = f"""task: 30
name: chatter
description: Say much, and move.
tree:
  sequence:
    - repeat:
        Say: {{text: {"x" * 900}}}
      times: 500
    - subtree: move_joints
      with: {{joints: {{joint_1: 0.1}}}}
    - subtree: move_joints
      with: {{joints: {{joint_1: 0.0}}}}
"""


@row(
    "slow-subscribers",
    "12 subscribers of events read nothing, while goals say more than the buffers of their"
    " connections take",
    "the goals succeed, and the server waits for none of them: it drops them; its memory grows"
    " little",
    limit=30,
    unit="MiB",
    times=2,
)
def slow_subscribers(scene: Scene) -> None:
    scene.write({"trees/30_chatter.yaml": CHATTER})
    board = scene.board()
    server = scene.serve("--activate", board=board)
    before = server.memory()
    with ExitStack() as stack:
        connections = [stack.enter_context(socket.socket()) for _ in range(12)]
        for connection in connections:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            connection.connect(server.address)
            name = f"{server.address[0]}:{server.address[1]}"
            request = f"GET /api/events HTTP/1.1\r\nHost: {name}\r\n\r\n"
            connection.sendall(request.encode())
        until("they watch", lambda: watchers(server) == 12)
        begin = time.monotonic()
        for _ in range(3):
            scene.succeeds(server, "a goal", task=30)
            scene.figure(server.memory() - before)
        scene.check(time.monotonic() - begin < 50, "the goals took 50 s")
        until("the server drops them", lambda: watchers(server) == 0)
    scene.check(board.ask("state")["frames"] > 20, "it did not move")


def watchers(server: Server) -> float:
    """How many clients watch the stream of events."""
    text = server.request("GET", "/metrics")[1]
    return float(re.search(r"^armtree_watchers (\S+)$", text, re.MULTILINE)[1])  # type: ignore[index]


@row(
    "many-goals",
    "1,000 goals, one right after the other; every 50th moves the arm",
    "all succeed, and memory grows little after 200 of them; in the end the server has as many"
    " descriptors as before the first one, and at most 3 threads more than after 200, the last of"
    " its pools",
    limit=10,
    unit="MiB",
    times=1,
)
def many_goals(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", "--policy", "queue", board=board)

    server.result(server.goal(21))  # the first plan
    descriptors = server.descriptors()

    def batch() -> None:
        goals = [server.goal(21 if number % 50 == 25 else 23) for number in range(100)]
        for goal in goals:
            result = server.result(goal)
            scene.check(result["code"] == "ok", f"{result['code']}: {result['message']}")

    for _ in range(2):
        batch()
    memory, threads = server.memory(), server.threads()
    for _ in range(8):
        batch()
    until("threads end", lambda: server.threads() <= threads + 3)
    until("descriptors are closed", lambda: server.descriptors() <= descriptors)
    scene.figure(server.memory() - memory)
    scene.check(board.ask("state")["angles"] == [90, 90, 90, 0], "it ends elsewhere")
    scene.injections = 1000
    server.signal(signal.SIGINT)
    scene.ended(server, 0)
    scene.verified()
