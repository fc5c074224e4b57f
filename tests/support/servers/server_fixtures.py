"""Servers for tests, each on a port of its own."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from executive.api import Policy, token_file
from executive.cli.main import main
from executive.testing import SharedPool
from hardware import RealClock, Robot, load_robot
from skills.motion import Pool
from tests.support.arms.quick_arm import quick_arm
from tests.support.servers.serving import Serve, Served, Typed


@pytest.fixture(scope="session")
def real_clock() -> RealClock:
    return RealClock()


@pytest.fixture(scope="session")
def quick_robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """The robot of all servers: motions take their real time."""
    return load_robot(quick_arm(tmp_path_factory.mktemp("robot")))


@pytest.fixture(scope="session")
def real_pool(quick_robot: Robot, real_clock: RealClock) -> Iterator[Pool]:
    pool = SharedPool(quick_robot, 1, real_clock)
    pool.start()
    yield pool
    pool.close()


@pytest.fixture
def serve(
    quick_robot: Robot,
    real_pool: Pool,
    real_clock: RealClock,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[Serve]:
    """Starts servers. Each is stopped when the test ends, and its token file must be removed."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    running: list[Served] = []

    def make(policy: Policy = Policy.REJECT, active: bool = True, **listen: Any) -> Served:
        served = Served(quick_robot, real_pool, tmp_path, real_clock)
        served.start(policy, active, **listen)
        running.append(served)
        return served

    yield make
    for served in running:
        served.stop()
        assert token_file.read(served.server.port) is None


@pytest.fixture
def typed(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> tuple[Served, Typed]:
    """A server, and a function that runs a command in this process."""
    served = serve(active=False)
    monkeypatch.setenv("ARMTREE_SERVER", served.server.url)

    def type_in(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["armtree", *words])
        status = 0
        try:
            main()
        except SystemExit as left:
            status = int(str(left.code))
        return status, *capfd.readouterr()

    return served, type_in
