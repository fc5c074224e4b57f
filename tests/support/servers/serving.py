"""A real server on a loopback socket, with the board in this process, in real time."""

import dataclasses
import http.client
import json
import os
import re
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from armtree import Client
from executive.api import Policy
from executive.api.operations import OPERATIONS
from executive.executive import Executive
from executive.goals.questions import Questions
from executive.server.server import ListenOptions, Server
from executive.setup import Setup
from executive.testing import SharedPool
from hardware import BoardLink, RealClock, Robot, load_robot
from skills.motion import Pool
from tests.support.arms.virtual_boards import virtual_board
from trees.live_library import LiveLibrary

TASKS = {
    "10_wait.yaml": "task: 10\nname: wait\ndescription: Wait.\ntree:\n  Wait: {duration: 1 h}\n",
    "11_nothing.yaml": "task: 11\nname: nothing\ndescription: Do nothing.\ntree:\n  Succeed: {}\n",
    "12_say.yaml": (
        "task: 12\nname: say\ndescription: Say something.\n"
        "parameters:\n  what: {type: text, default: well, description: what}\n"
        "  often: {type: number, default: 1, min: 1, max: 3, description: how often}\n"
        "tree:\n  Say: {text: $what, value: $often}\n"
    ),
    "14_ask.yaml": (
        "task: 14\nname: ask\ndescription: Ask.\ntree:\n  Ask: {question: Free?, wanted: 'yes'}\n"
    ),
    "13_fail.yaml": "task: 13\nname: fail\ndescription: Fail.\ntree:\n  Fail: {reason: so}\n",
}


class Served:
    """An executive and its server, from start to stop, or to the end of its longest time [s]."""

    def __init__(
        self,
        robot: Robot,
        pool: Pool,
        folder: Path,
        clock: RealClock,
        link: BoardLink[Any] | None = None,
        longest: float = 300.0,
    ) -> None:
        self.clock, self.folder = clock, folder
        self.tasks = folder / "tasks"
        self.tasks.mkdir(exist_ok=True)
        for name, text in TASKS.items():
            (self.tasks / name).write_text(text)
        wait = 1.0 if robot.firmware.reports_pose else 0.01  # the former ends with the report
        self.robot = dataclasses.replace(
            robot, serial=dataclasses.replace(robot.serial, boot_wait=wait)
        )
        self.link: BoardLink[Any] = link or BoardLink(virtual_board(self.robot), clock)
        self.library = LiveLibrary(self.tasks, self.robot)
        self._pool, self._ended, self._longest = pool, False, longest

    def start(self, policy: Policy = Policy.REJECT, active: bool = True, **listen: Any) -> None:
        """Serve on a free port."""
        questions = Questions(self.clock)
        setup = Setup(recordings=self.folder / "recordings", policy=policy)
        self.executive = Executive(
            setup, self.robot, self.link, self.library, self._pool, self.clock, questions
        )
        options = ListenOptions(**{"port": 0, **listen})
        self.server = Server(self.executive, options, questions)
        self.executive.start()
        self.server.start()
        # A test that waits too long fails, because the server ends.
        self._watchdog = threading.Timer(self._longest, self._end)
        self._watchdog.daemon = True
        self._watchdog.start()
        self.executive.arm_to("configure")
        if active:
            self.executive.arm_to("activate")

    def stop(self) -> None:
        """End as `armtree serve` does."""
        self._watchdog.cancel()
        self._watchdog.join()
        if not self._ended:
            self._end()

    def _end(self) -> None:
        self._ended = True
        self.executive.close()
        self.server.stop()

    def client(self) -> Client:
        """A client, which finds the token in its file."""
        return Client(self.server.url)

    def ask(
        self,
        method: str,
        path: str,
        body: object = None,
        headers: Mapping[str, str] | None = None,
        token: bool = True,
    ) -> tuple[int, Any]:
        """Send a request; return the status and the JSON. An error must be one of its row."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=60)
        sent = {"authorization": f"Bearer {self.server.token}"} if token else {}
        data = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
        if data is not None:
            sent["content-type"] = "application/json"
        try:
            connection.request(method, path, data, {**sent, **(headers or {})})
            response = connection.getresponse()
            text = response.read()
        finally:
            connection.close()
        assert response.headers["x-content-type-options"] == "nosniff"
        json_comes = response.headers["content-type"] == "application/json"
        fields = json.loads(text) if json_comes and text else text
        if response.status >= 400 and isinstance(fields, dict):
            assert fields["code"].startswith("request.") or fields["code"] in declared(method, path)
        return response.status, fields


class Codes(tuple[str, ...]):
    """Codes of errors, and families of codes."""

    def __contains__(self, code: object) -> bool:
        return isinstance(code, str) and any(f"{code}.".startswith(f"{each}.") for each in self)


def declared(method: str, path: str) -> Codes:
    """The errors that the operation at a path may answer."""
    plain = path.partition("?")[0].rstrip("/")
    for row in OPERATIONS.values():
        if row.method == method and re.fullmatch(re.sub(r"{\w+}", "[^/]+", row.path), plain):
            return Codes(row.errors)
    return Codes()


Serve = Callable[..., Served]
Typed = Callable[..., tuple[int, str, str]]  # types a command: its status and what it prints


@contextmanager
def serving() -> Iterator[Served]:
    """A server with an active arm, for programs that are not tests."""
    clock = RealClock()
    pool = SharedPool(load_robot(None), 1, clock)
    pool.start()
    with tempfile.TemporaryDirectory() as name:
        os.environ["XDG_RUNTIME_DIR"] = name
        served = Served(load_robot(None), pool, Path(name), clock, longest=3600.0)
        served.start(Policy.REJECT, active=True)
        yield served
        served.stop()
    pool.close()
