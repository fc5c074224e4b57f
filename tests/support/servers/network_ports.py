"""Ways to reach an executive over the network, to measure them."""

import http.client
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from websockets.sync.client import connect

from executive.executive import Executive
from executive.goals.questions import Questions
from executive.server.server import ListenOptions, Server

Cancel = Callable[[], object]

# The most expensive data that a client without the token can send: bodies and messages of 64 KiB
# with thousands of keys, without end, on four connections of each kind.
FLOOD = """
import socket, sys, threading
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
port = int(sys.argv[1])
keys = "{" + ",".join(f'"{number}":1' for number in range(6500)) + "}"
head = f"POST /api/cancel HTTP/1.1\\r\\nhost: 127.0.0.1:{port}\\r\\n"
head += "content-type: application/json\\r\\n"
ask = f"{head}content-length: {len(keys)}\\r\\n\\r\\n{keys}".encode()
def request():
    with socket.create_connection(("127.0.0.1", port), 10) as connection:
        connection.sendall(ask)
        while connection.recv(65536):
            pass
def publish():
    with connect(f"ws://127.0.0.1:{port}/", compression=None, ping_interval=None) as bridge:
        while True:
            bridge.send('{"op":"publish",' + keys[1:])
def again(act):
    while True:
        try:
            act()
        except (OSError, WebSocketException):
            pass
def cut_off(raised):
    # The server must drop these clients; all other errors are reported.
    if not issubclass(raised.exc_type, (OSError, WebSocketException)):
        threading.__excepthook__(raised)
threading.excepthook = cut_off
for act in (request, publish) * 4:
    threading.Thread(target=again, args=(act,), daemon=True).start()
print(flush=True)
sys.stdin.read()
"""


@contextmanager
def served(arm: Executive) -> Iterator[Server]:
    """A server for an executive, on a free port."""
    with tempfile.TemporaryDirectory() as runtime:
        os.environ["XDG_RUNTIME_DIR"] = runtime
        listen = ListenOptions(port=0, rosbridge=True)
        server = Server(arm, listen, Questions(arm.clock))
        server.start()
        yield server
        server.stop()


@contextmanager
def over_http(arm: Executive) -> Iterator[Cancel]:
    """Yield a function that cancels all goals by a request on an open connection."""
    with served(arm) as server:
        connection = http.client.HTTPConnection("127.0.0.1", server.port)

        def cancel() -> None:
            connection.request("POST", "/api/stop")
            response = connection.getresponse()
            assert response.status == 200, response.read()
            response.read()

        yield cancel
        connection.close()


@contextmanager
def in_a_flood(arm: Executive) -> Iterator[Cancel]:
    """Yield a function that stops the arm on a new connection, during a flood of requests."""
    with served(arm) as server:
        command, pipe = [sys.executable, "-c", FLOOD, str(server.port)], subprocess.PIPE

        def cancel() -> None:
            connection = http.client.HTTPConnection("127.0.0.1", server.port)
            connection.request("POST", "/api/stop")
            assert connection.getresponse().status == 200
            connection.close()

        with subprocess.Popen(command, stdin=pipe, stdout=pipe) as flood:
            assert flood.stdin
            assert flood.stdout
            flood.stdout.readline()
            yield cancel
            flood.stdin.close()


def rosbridge_results(
    server: Server, task: int, count: int, between: Callable[[], None]
) -> list[float]:
    """Times from a goal to its result, sent as roslibpy does [ms]; `between` is not timed."""
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
            while (reported := json.loads(socket.recv()))["op"] != "action_result":
                pass
            times.append((time.monotonic() - begun) * 1000)
            assert reported["values"] == {"success": True}
            between()
    return times
