"""What clients do to a server, most of them without manners. Each act ends by itself."""

import contextlib
import json
import random
import signal
import socket
import time
from collections.abc import Callable

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from tests.faults.process import INTERRUPTED, kill
from tests.faults.row import TASKS

from .site import Site

_TASKS = (0, 1, 2, 20, 21, 21, 22, 23, 24, 25, 26, 27)
_TYPE = "arduinobot_msgs/action/ArduinobotTask"


def pause(random: random.Random, most: float) -> None:
    """Wait for a random time [s], or until the program is to end."""
    end = time.monotonic() + random.uniform(0.0, most)
    while (left := end - time.monotonic()) > 0.0 and not INTERRUPTED.is_set():
        time.sleep(min(left, 0.05))  # noqa: TID251, real time passes for a real server


def goal(site: Site, random: random.Random) -> None:
    """Send a goal; wait for its end, or stop it, or leave it alone."""
    goal_id = site.send(random.choice(_TASKS))
    if not goal_id:
        return
    ending = random.choice(["wait", "cancel", "leave", "stop"])
    pause(random, 3.0)
    if ending == "cancel":
        site.request("POST", f"/api/goals/{goal_id}/cancel", {})
    elif ending == "stop":
        stop(site, random)
    elif ending == "wait":
        site.result(goal_id, random.uniform(1.0, 8.0))


def stop(site: Site, _: random.Random) -> None:
    site.stop()


def pauses(site: Site, random: random.Random) -> None:
    """Pause, step and resume at random moments; most come too late or too early."""
    goal_id = site.send(random.choice([20, 21, 26, 1]))
    for _ in range(random.randint(1, 6) if goal_id else 0):
        pause(random, 0.8)
        what = random.choice(["pause", "pause", "resume", "step"])
        site.request("POST", f"/api/goals/{goal_id}/{what}", {})
    if goal_id and random.random() < 0.7:
        site.request("POST", f"/api/goals/{goal_id}/cancel", {})


def wrong_goals(site: Site, random: random.Random) -> None:
    """Goals that are refused, or fail before anything moves."""
    site.send(random.choice([77, 2**31 - 1]))
    site.send(27, arguments={"swing": random.choice(["400 deg", "nan", "", "x" * 500, [1], {}])})
    site.send(27, arguments={"times": random.choice([0, -1, 10**30, "two"])})
    site.send(21, goal_id="0" * 31 + random.choice("01"))
    site.send(21, deadman=True, goal_id=f"{random.getrandbits(128):032x}")
    site.send(27, arguments={"swing": f"{random.randint(1, 60)} deg", "times": 1})


def breakpoints(site: Site, random: random.Random) -> None:
    """Set a breakpoint, let a goal reach it, and remove it."""
    node = random.choice(["step/move_joints", "nothing/Succeed", "no/such"])
    site.request("POST", "/api/breakpoints", {"node": node})
    goal_id = site.send(21)
    pause(random, 2.0)
    if goal_id and random.random() < 0.5:
        site.request("POST", f"/api/goals/{goal_id}/resume", {})
    site.request("POST", "/api/breakpoints", {"node": node, "on": False})


def questions(site: Site, random: random.Random) -> None:
    """A task asks; answer it with anything, in time or not."""
    site.send(24)
    pause(random, 1.5)
    for question in site.request("GET", "/api/questions")[1].get("questions", ()):
        answer = random.choice(["yes", "no", "y", "perhaps"])
        path = f"/api/questions/{question['question_id']}/answer"
        site.request("POST", path, {"answer": answer})


def reads(site: Site, random: random.Random) -> None:
    """Read everything that can be read."""
    for path in ("/api/status", "/api/tasks", "/api/goals", "/metrics", "/openapi.json"):
        site.request("GET", path)


def recordings(site: Site, random: random.Random) -> None:
    """Read a recording, finished or not, or a part of its file."""
    found = site.request("GET", "/api/recordings?limit=20")[1].get("recordings", ())
    if not found:
        return
    path = f"/api/recordings/{random.choice(found)['name']}"
    for part in ("", "/series?points=100", f"/events?at={random.uniform(0, 5):g}", "/nodes"):
        site.request("GET", path + part)
    with socket.create_connection(site.server.address, 10) as line:
        line.sendall(f"GET {path}/file HTTP/1.1\r\nHost: %s:%d\r\n\r\n".encode() % host(site))
        pause(random, 0.5)
        line.recv(random.choice([1, 1000, 100_000]))


def lifecycle(site: Site, random: random.Random) -> None:
    """Change the state of the arm, whatever it is now."""
    for _ in range(random.randint(1, 3)):
        what = random.choice(["activate", "activate", "configure", "deactivate", "cleanup"])
        site.request("POST", f"/api/arm/{what}", {})


def stream(site: Site, random: random.Random) -> None:
    """Subscribe to the events; read them or not, and go without a word."""
    with socket.create_connection(site.server.address, 10) as line:
        line.sendall(b"GET /api/events HTTP/1.1\r\nHost: %s:%d\r\n\r\n" % host(site))
        if random.random() < 0.3:
            pause(random, 6.0)  # reads nothing
            return
        line.settimeout(0.5)
        end = time.monotonic() + random.uniform(0.1, 6.0)
        while time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                if not line.recv(65536):
                    return


def host(site: Site) -> tuple[bytes, int]:
    return site.server.address[0].encode(), site.server.address[1]


def broken(site: Site, random: random.Random) -> None:
    """Half a request, noise, a body without an end, or nothing at all."""
    noise = random.randbytes(random.choice([1, 300, 5000]))
    head = b"POST /api/goals HTTP/1.1\r\nHost: %s:%d\r\nContent-Length: 70000\r\n\r\n" % host(site)
    with (
        contextlib.suppress(OSError),  # the server may close the connection at any time
        socket.create_connection(site.server.address, 10) as line,
    ):
        line.sendall(random.choice([b"", b"GET /api/st", noise, head, head + noise]))
        pause(random, 4.0)


def rosbridge(site: Site, random: random.Random) -> None:
    """A client of the original robot, that may leave before its goal ends."""
    url = site.server.url.replace("http", "ws")
    with (
        contextlib.suppress(WebSocketException, TimeoutError),
        connect(url, close_timeout=1, open_timeout=30) as line,
    ):
        topic = {"op": "subscribe", "topic": "/joint_states", "type": "sensor_msgs/msg/JointState"}
        line.send(json.dumps(topic))
        number, identity = random.choice(_TASKS), f"soak {random.random()}"
        message = {"op": "send_action_goal", "id": identity, "action": "/task_server"}
        arguments = {"action_type": _TYPE, "args": {"task_number": number}, "feedback": True}
        line.send(json.dumps({**message, **arguments}))
        if random.random() < 0.5:
            pause(random, 2.0)
            line.send(json.dumps({**message, "op": "cancel_action_goal"}))
        if random.random() < 0.2:
            line.send(random.choice(["{", "[]", '{"op": 7}', "x" * 5000]))
        end = time.monotonic() + random.uniform(0.1, 5.0)
        while time.monotonic() < end:
            line.recv(timeout=1.0)
        if random.random() < 0.5:
            line.socket.shutdown(socket.SHUT_RDWR)


def commands(site: Site, random: random.Random) -> None:
    """A command of a person, ended by itself, by Ctrl-C, or without mercy."""
    task = str(random.choice(_TASKS))
    words = random.choice(
        [
            ["status"],
            ["watch"],
            ["send", task, "--wait"],
            ["send", task, "--deadman"],
            ["send", task],
        ]
    )
    command = site.command(*words)
    ends = {"watch": ["SIGINT", "SIGKILL"], "send": ["SIGINT", "SIGKILL", "SIGTERM", ""]}
    name = random.choice(ends.get(words[0], [""]))
    if name or words[0] == "send":
        pause(random, 8.0)
    # A task without end does not end; its goal is canceled.
    number = signal.Signals[name or "SIGINT"]
    if name or "--wait" in words or "--deadman" in words:
        kill(command.pid, number)
    site.ended(command)


def edit(site: Site, random: random.Random) -> None:
    """Break a task file while it may be read, and mend it."""
    path = site.folder / "trees" / "23_nothing.yaml"
    good = (TASKS / path.name).read_text()  # another edit may have broken the copy
    path.write_text(random.choice(["", "task: 23\ntree: [", "\0", good[: len(good) // 2]]))
    try:
        site.send(21)
        pause(random, 0.5)
    finally:
        path.write_text(good)


ACTS: tuple[tuple[Callable[[Site, random.Random], None], int], ...] = (
    (goal, 8),
    (pauses, 4),
    (wrong_goals, 1),
    (breakpoints, 1),
    (questions, 1),
    (reads, 2),
    (recordings, 2),
    (lifecycle, 1),
    (stream, 3),
    (broken, 2),
    (rosbridge, 3),
    (commands, 2),
    (edit, 1),
    (stop, 1),
)
