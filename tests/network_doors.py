"""The ways in over the network, for measurements of them."""

import http.client
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from websockets.sync.client import connect

from executive.executive import Executive
from executive.live_library import LiveLibrary
from executive.questions import Questions
from executive.server.server import Place, Server
from hardware import RealClock, Robot

Cancel = Callable[[], object]


@contextmanager
def served(arm: Executive, robot: Robot, folder: Path) -> Iterator[Server]:
    """A server for an executive, on a port that is free."""
    clock = RealClock()
    with tempfile.TemporaryDirectory() as runtime:
        os.environ["XDG_RUNTIME_DIR"] = runtime
        library = LiveLibrary(folder / "tasks", robot)
        place, questions = Place(port=0, rosbridge=True), Questions(clock)
        server = Server(arm, library, robot, clock, place, questions)
        server.start()
        yield server
        server.stop()


@contextmanager
def over_http(arm: Executive, robot: Robot, folder: Path) -> Iterator[Cancel]:
    """What cancels all goals by a request, on a connection that is open."""
    with served(arm, robot, folder) as server:
        connection = http.client.HTTPConnection("127.0.0.1", server.port)

        def cancel() -> None:
            connection.request("POST", "/api/stop")
            response = connection.getresponse()
            assert response.status == 200, response.read()
            response.read()

        yield cancel
        connection.close()


def rosbridge_results(server: Server, task: int, count: int) -> list[float]:
    """From a goal to its result, asked as roslibpy does [ms]."""
    times = []
    with connect(f"ws://127.0.0.1:{server.port}/", compression=None) as socket:
        for number in range(count):
            goal = {
                "op": "send_action_goal",
                "id": f"send_action_goal:/task_server:{number}",
                "action": "/task_server",
                "action_type": "arduinobot_msgs/action/ArduinobotTask",
                "args": {"task_number": task},
                "feedback": True,
            }
            begun = time.monotonic()
            socket.send(json.dumps(goal))
            while (told := json.loads(socket.recv()))["op"] != "action_result":
                pass
            times.append((time.monotonic() - begun) * 1000)
            assert told["values"] == {"success": True}
    return times
