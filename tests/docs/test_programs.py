"""The pages whose programs run side by side: each line is typed, in a network of its own.

There the ports are those of the pages, whatever else runs on this machine.
"""

import asyncio
import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcp import Client
from mcp.client.stdio import StdioServerParameters
from mcp_types import TextContent

from executive.api.codes import INTERRUPTED_EXIT
from executive.ros2 import installation
from tests.docs.test_blocks import BLOCKS, lines
from tests.faults.process import Command
from tests.support.arms.quick_arm import quick_arm
from tests.support.paths import PEERS, ROOT

pytestmark = pytest.mark.slow

# What a program prints when it is ready; each line that holds the words of a key never ends.
READY = {
    "armtree fleet up": "The page of the fleet",
    "armtree mcp --http": "Clients connect to",
    "armtree ros2": "connected to http",
    "armtree serve": "is ready to take commands",
    "--fleet": "this arm is bench.arm-",
}
HOLD = "ip link set lo up && echo up && exec cat"


class Terminals:
    """Types lines into terminals of one user, each in the same folder and the same network.

    Args:
        folder: Folder of the user.
        network: Words before a command that put it into the network.
    """

    def __init__(self, folder: Path, network: list[str]) -> None:
        self.folder, self.network = folder, network
        self.environment = {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "HOME": str(folder),
            "XDG_RUNTIME_DIR": str(folder),
            "ARMTREE_ROBOT": str(quick_arm(folder)),
        }
        self._started: list[Command] = []

    def type(self, line: str) -> str:
        """Type a line, and wait until its program is ready or has ended; return what it printed."""
        typed = Command(self.folder, shlex.split(line), self.environment, argv=self.network)
        self._started.append(typed)
        ready = [words for key, words in READY.items() if key in line]
        for words in ready:
            typed.until_printed(words)
        assert ready or typed.wait() == 0, f"{line}\n{typed.text()}"
        return typed.text()

    def interrupt(self) -> list[int]:
        """Press Ctrl-C in every terminal, the newest first; return the exit statuses."""
        left = [each for each in reversed(self._started) if each.popen.poll() is None]
        for each in left:
            each.signal(signal.SIGINT)
            each.wait()
        return [each.popen.returncode for each in left]

    def close(self) -> None:
        for each in self._started:
            each.close()


@pytest.fixture
def terminals(tmp_path: Path) -> Iterator[Terminals]:
    new = ["unshare", "--user", "--map-root-user", "--net", "sh", "-c", HOLD]
    with subprocess.Popen(new, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout
        if not holder.stdout.readline():
            pytest.skip("no network namespace can be made here, so the lines were not typed")
        enter = ["nsenter", "-t", str(holder.pid), "--user", "--net", "--preserve-credentials"]
        started = Terminals(tmp_path, enter)
        try:
            yield started
        finally:
            started.close()


def typed(page: str) -> list[str]:
    """The lines of a page, without those that install."""
    return lines(page, left_out=("make ",))


def test_the_fleet(terminals: Terminals) -> None:
    printed = {line: terminals.type(line) for line in typed("how_to/fleet.md")}
    assert "SUCCEEDED" in printed["armtree fleet send pick --pool bench --wait"]
    assert "arm-7" in printed["armtree fleet ls"]
    assert "arm-8" in printed["armtree fleet ls"]
    assert "bench.arm-7 stop confirmed" in " ".join(printed["armtree fleet stop"].split())
    assert terminals.interrupt() == [0, 0, 0]


def test_the_node_of_ros_2(terminals: Terminals) -> None:
    environment = installation.environment()
    if environment is None:
        pytest.skip("ROS 2 is not installed in .venv/ros2: make ros2")
    for line in typed("how_to/ros2.md"):
        terminals.type(line)
    asked = "".join(f'["trigger", "{space}", "run_rest"]\n' for space in ("", "/left"))
    answers = subprocess.run(
        [*terminals.network, sys.executable, PEERS / "ros2_peer.py"],
        env={**environment, "HOME": str(terminals.folder), installation.DISCOVERY: "LOCALHOST"},
        input=asked,
        text=True,
        check=True,
        stdout=subprocess.PIPE,
    ).stdout
    assert [json.loads(line)[0] for line in answers.splitlines()] == [True, True]
    assert terminals.interrupt() == [0, INTERRUPTED_EXIT, INTERRUPTED_EXIT, 0]


def test_the_tools_for_language_models(terminals: Terminals) -> None:
    for line in typed("how_to/language_models.md"):
        terminals.type(line)
    terminals.type("armtree mcp --http 8766")
    (block,) = (each for each in BLOCKS if each[:2] == ("how_to/language_models.md", "json"))
    configured = json.loads(block.text)["mcpServers"]["armtree"]
    client = Client(
        StdioServerParameters(
            command=terminals.network[0],
            args=[*terminals.network[1:], configured["command"], *configured["args"]],
            env=terminals.environment,
        )
    )

    async def act() -> str:
        async with asyncio.timeout(60), client:
            (said,) = (await client.call_tool("run_task", {"task": "rest"})).content
            assert isinstance(said, TextContent)
            return said.text

    assert "SUCCEEDED" in asyncio.run(act())
    assert terminals.interrupt() == [INTERRUPTED_EXIT, 0]
