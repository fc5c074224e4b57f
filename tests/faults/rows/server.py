"""Hostile clients of a server: a stop is answered in every flood."""

import contextlib
import http.client
import itertools
import json
import resource
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from websockets.sync.client import connect

from tests.faults.board import Board, Read
from tests.faults.process import Command, Hang, Server, until
from tests.faults.row import Row, Scene, delays, motions_of, row
from tests.support.recordings.large_messages import LARGE

T = TypeVar("T")
HOSTILE = Path(__file__).parents[1] / "means" / "hostile.py"
CLIENTS = 80
GOALS = 8  # per flood
STOPS = 14  # per goal: one in motion, and more while nothing moves
SERVED = 80  # times that the clients are served before the first goal, and during the goals
MEMORY = 20  # that a server may take more in a flood [MiB]


def flood(kind: str, fault: str, stops: bool = False, clients: int = CLIENTS) -> Row:
    """A row: hostile clients of one kind, and another client that stops goals in motion.

    Args:
        kind: As in `means/hostile.py`.
        fault: What each client does.
        stops: Whether that stops the arm. Such clients are frozen while a goal begins to move, and
            then it counts from their first stop.
        clients: How many there are.
    """

    @row(
        f"flood-{kind.replace(' ', '-')}",
        f"{clients:,} clients: {fault}",
        "three kinds of figures, each within the limit: from a stop of another client during a"
        " motion, or the first of such a flood, to its answer and to the last frame on the wire;"
        " from a stop of an arm that stands; from when each frame was due to the board. The server"
        f" takes less than {MEMORY} MiB more",
        # A loop that is 5 ms late cannot be seen here: clients that compute take both processors,
        # and an idle program is as late. So frames have the limit of a stop.
        limit=50,
        worst=250,
        unit="ms",
        times=1,
        alone=True,
    )
    def inject(scene: Scene) -> None:
        board = scene.board()
        server = scene.serve("--activate", "--rosbridge", board=board)
        line = kind, str(server.address[1]), str(clients)
        crowd = scene.armtree(*line, argv=(sys.executable, HOSTILE))
        memory = server.memory()
        begun = until("the flood to work", lambda: (n := served(crowd)) > SERVED and n)
        earlier, most = 0, memory
        for _ in range(GOALS):
            if stops:
                crowd.signal(signal.SIGSTOP)
            goal = until("a goal in motion", partial(in_motion, scene, server, board))
            begin = crowd.signal(signal.SIGCONT)
            server.stop()
            answered = time.monotonic()
            result = persistent(partial(server.result, goal))
            state = result["state"]
            scene.check(state == "CANCELED", f"the goal ended {state}")
            frames = until("the hold frame", partial(held, board))
            scene.figure(1000 * (max(answered, frames[-1].time) - begin), "in motion")
            since, earlier = [each.time for each in frames[earlier:-1]], len(frames)
            for late in delays(since, motions_of(scene.folder / result["recording"])):
                scene.figure(1000 * (max(late, default=0.0) - min(late, default=0.0)), "late")
            for _ in range(STOPS - 1):
                until("a while", lambda: scene.random.random() < 0.2)
                scene.figure(1000 * server.stop(), "standing")
            most = max(most, server.memory())
            scene.check(len(board.frames()) == len(frames), "a frame was sent after the stop")
        scene.check(crowd.popen.poll() is None, "the clients ended too early")
        more = served(crowd) - begun
        scene.check(more > SERVED, f"meanwhile the clients were served {more} times")
        more = most - memory
        scene.check(more < MEMORY, f"the server takes {more:.0f} MiB more")
        scene.injections = GOALS * STOPS

    return inject


def served(crowd: Command) -> int:
    """How often the server has answered hostile clients, or let go of them."""
    return int((crowd.output.read_text().split() or ["0"])[-1])


def persistent(request: Callable[[], T]) -> T:
    """The answer to a request that is no stop, in one of many tries.

    Of too many connections, the server closes the oldest. That of a stop is never one of them.
    """

    def answered() -> T | None:
        with contextlib.suppress(ConnectionError):
            return request()
        return None

    answer: T = until("an answer", answered)
    return answer


def in_motion(scene: Scene, server: Server, board: Board) -> str:
    """A goal that moves; empty if it is refused, or ended by what a flood has sent before."""
    count = len(board.frames()) + scene.random.randint(1, 6)
    goal = f"{scene.random.getrandbits(128):032x}"  # known also if the answer is lost
    persistent(partial(server.post, "/api/goals", {"task": 20, "goal_id": goal}))
    while len(board.frames()) < count:
        found = persistent(partial(server.get, f"/api/goals/{goal}"))
        if found.get("state") not in ("ACCEPTED", "EXECUTING"):
            return ""
        with contextlib.suppress(Hang):  # few requests: the server is to be idle but for the flood
            until("it moves", lambda: len(board.frames()) >= count, 0.5)
    return goal


def held(board: Board) -> Sequence[Read]:
    """All frames, once the last one repeats the one before."""
    frames = board.frames()
    return frames if frames[-1].data == frames[-2].data else ()


flood_connections = flood("connections", "connect and leave")
flood_held = flood(
    "held connections",
    "connect, stay until the server closes, and return in a second",
    clients=10_000,
)
flood_stops = flood("stops", "stop the arm, each time on a new connection", stops=True)
flood_open = flood("stops on open connections", "stop the arm again and again", stops=True)
flood_pipelined = flood("pipelined stops", "send 500 stops at once", stops=True)
flood_bodies = flood(
    "stops with bodies", "stops with bodies, and a part of each body comes later", stops=True
)
flood_long = flood("long stops", "stops with 11,000 header lines")
flood_wide = flood("wide stops", "stops with 480 header lines in 2 kB")
flood_foreign_long = flood("foreign long stops", "stops with 11,000 header lines for another host")
flood_foreign = flood("foreign stops", "stops for another host")
flood_endless = flood("endless stops", "stops with 11,000 header lines and no end")
flood_unfinished = flood("unfinished stops", "send a stop but for its last line, and leave")
flood_behind = flood("stops behind lines", "stops as the last of 8 kB of header lines")
flood_chunks = flood("chunks", "stops with bodies of a thousand chunks and no end", stops=True)
flood_cancels = flood("long cancels", "cancels with 11,000 header lines")
flood_bodies_huge = flood("huge bodies", "goals with bodies of 1 GB")
flood_json = flood("bad JSON", "goals of 60,000 brackets")
flood_frames = flood(
    "rosbridge frames",
    "WebSocket frames: pings, no mask, no end, 2^62 bytes, other codes, no JSON; 16 are let in",
)
flood_goals = flood("rosbridge goals", "goals through rosbridge; 16 of them are let in")
flood_rosbridge = flood("rosbridge cancels", "cancels through rosbridge; 16 are let in")


@row(
    "large-messages",
    "clients read recordings of less than 1 MB with messages of 1 to 14 MB, while the arm moves",
    "a stop, and each frame, is in time; the server takes less than 500 MiB",
    limit=50,
    worst=250,
    unit="ms",
    times=1,
    alone=True,
)
def large_messages(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board)
    scene.injections, earlier = len(LARGE), 0
    for name, make in LARGE.items():
        path = scene.folder / "recordings" / "20260101T000000.000Z-1.mcap"
        path.write_bytes(make())
        goal = until("a goal in motion", partial(in_motion, scene, server, board))
        over, answers = threading.Event(), list[int]()
        reader = threading.Thread(target=read_all, args=(server, path.name, over, answers))
        reader.start()
        until("a while", lambda: scene.random.random() < 0.006)
        scene.figure(1000 * server.stop(), "in motion")
        for _ in range(STOPS):
            until("a while", lambda: scene.random.random() < 0.2)
            scene.figure(1000 * server.stop(), "standing")
        over.set()
        reader.join()
        result = server.result(goal)
        frames = until("the hold frame", partial(held, board))
        since, earlier = [each.time for each in frames[earlier:-1]], len(frames)
        for late in delays(since, motions_of(scene.folder / result["recording"])):
            scene.figure(1000 * (max(late, default=0.0) - min(late, default=0.0)), "late")
        known = set(answers) <= {200, 409, 429}
        scene.check(bool(answers) and known, f"{name}: the reader was answered {answers}")
        memory = server.memory()
        scene.check(memory < 500, f"{name}: the server takes {memory:.0f} MiB")
        path.unlink()


def read_all(server: Server, name: str, over: threading.Event, answers: list[int]) -> None:
    """Read what a server has of a recording, packed as for a browser, until it is over."""
    for part in itertools.cycle(("", "/events", "/events?at=20", "/series", "/nodes")):
        connection = http.client.HTTPConnection(*server.address, timeout=30)
        with contextlib.closing(connection):
            packed = {"accept-encoding": "gzip"}
            connection.request("GET", f"/api/recordings/{name}{part}", headers=packed)
            response = connection.getresponse()
            while response.read(65_536):
                pass
            answers.append(response.status)
        if over.is_set():
            return


@row(
    "descriptors",
    "`ulimit -n 36`, and 40 idle connections",
    "stops and goals are answered, and the log stays below 10 KiB; with 20, the server does not "
    "start, and one line says what it needs",
    limit=50,
    unit="ms",
    times=3,
    quick=1,
)
def descriptors(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", board=board, limits={resource.RLIMIT_NOFILE: 36})
    with contextlib.ExitStack() as stack:
        for _ in range(40):
            stack.enter_context(socket.create_connection(server.address))
        for _ in range(3):
            goal = server.goal(20)
            until("a goal in motion", lambda: server.get("/api/status")["percentage"])
            for _ in range(10):
                stack.enter_context(socket.create_connection(server.address))
                scene.figure(1000 * server.stop())
            state = server.result(goal)["state"]
            scene.check(state == "CANCELED", f"the goal ended {state}")
    size = len(server.text())
    scene.check(size < 10_240, f"the log has {size} bytes")
    fewer = scene.armtree(
        *("serve", "--tcp-port", "0", "--port", "virtual"), limits={resource.RLIMIT_NOFILE: 20}
    )
    scene.ended(fewer, 3, what="with 20")
    said = fewer.text().splitlines()
    scene.check(len(said) == 1 and "ulimit -n" in said[0], f"with 20, it says {said}")
    scene.verified()


@row(
    "rosbridge-recordings",
    "16 clients without a token send goals through rosbridge for 10 s",
    "they leave at most 60 recordings, and one more per second; each goal is answered",
    times=1,
)
def rosbridge_recordings(scene: Scene) -> None:
    server = scene.serve("--activate", "--rosbridge")
    crowd = scene.armtree(
        *("rosbridge goals", str(server.address[1]), "16"), argv=(sys.executable, HOSTILE)
    )
    begin = time.monotonic()
    until("10 s", lambda: time.monotonic() > begin + 10)
    goal = {"op": "send_action_goal", "action": "/task_server", "args": {"task_number": 23}}
    goal |= {"action_type": "arduinobot_msgs/action/ArduinobotTask", "id": "mine"}
    crowd.close()
    with connect(server.url.replace("http", "ws"), compression=None) as mine:
        for _ in range(3):  # it earns one a second, also while this connects
            mine.send(json.dumps(goal))
            answer = json.loads(mine.recv(30))
            scene.check(answer.get("id") == "mine", f"one goal more is answered: {answer}")
    scene.check("request.too_many" in str(answer), f"goals at once are answered: {answer}")
    found, seconds = len(scene.recordings()), time.monotonic() - begin
    scene.check(5 < found <= 62 + seconds, f"{found} recordings in {seconds:.0f} s")


@row(
    "rosbridge-numbers",
    "a goal through rosbridge with a number of 5,000 digits, NaN, or without arguments",
    "each is answered under its id; without arguments the task is 0, as in rosbridge",
    times=2,
)
def rosbridge_numbers(scene: Scene) -> None:
    server = scene.serve("--activate", "--rosbridge")
    goal = {"op": "send_action_goal", "action": "/task_server", "id": "mine"}
    goal |= {"action_type": "arduinobot_msgs/action/ArduinobotTask"}
    with connect(server.url.replace("http", "ws"), compression=None) as mine:
        for number in ("9" * 5000, "-1e400", "NaN", "9" * 60_000):
            text = json.dumps({**goal, "args": {"task_number": 1}})
            mine.send(text.replace(": 1}", f": {number}}}"))
            answer = json.loads(mine.recv(30))
            named = (answer.get("op"), answer.get("id"), answer.get("result"))
            scene.check(named == ("action_result", "mine", False), f"{number[:9]}: {answer}")
        mine.send(json.dumps({**goal, "args": {}}))
        answer = json.loads(mine.recv(30))
        scene.check(answer.get("op") == "action_result", f"{{}}: {answer}")
    tasks = [each["task"] for each in server.get("/api/goals")["goals"]]
    scene.check(tasks == [0], f"the tasks are {tasks}")
