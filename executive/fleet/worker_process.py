"""The worker of `armtree serve --fleet`: its own process, and a client of the server."""

import logging
import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Self

from hardware import RealClock

from .errors import check_name

logger = logging.getLogger(__name__)

_END_SECONDS = 5.0  # longest time for the last result


@dataclass(frozen=True, slots=True)
class FleetPlace:
    """The place of an arm in a fleet.

    Attributes:
        url: URL of the fleet.
        pool: Name of the pool.
        name: Name of the arm in the pool.
    """

    url: str
    pool: str
    name: str

    @classmethod
    def of(cls, url: str, pool: str, name: str | None) -> Self:
        """Return a place. The default name is the name of this machine.

        Raises:
            BadName: A name is malformed.
        """
        own = re.sub(r"[^\w-]", "-", socket.gethostname(), flags=re.ASCII)[:32]
        return cls(url, check_name("a pool", pool), check_name("an arm", name or own))


@contextmanager
def worker_of(place: FleetPlace, server: str, token: str, page: str) -> Iterator[None]:
    """Run the worker of a server during the context. It also ends if this process dies.

    This process never waits for the fleet.

    Args:
        place: Place of the arm in the fleet.
        server: URL of the server.
        token: Token of the server.
        page: URL of the page of the server, for other machines.
    """
    words = ["fleet", "join", "--child", "--server", server, "--fleet", place.url]
    process = subprocess.Popen(
        [
            sys.executable,
            "-P",
            "-m",
            "executive",
            *words,
            "--pool",
            place.pool,
            "--name",
            place.name,
            "--page",
            page,
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "ARMTREE_TOKEN": token},
        start_new_session=True,  # Ctrl-C is for this process, which then ends the worker in order
    )
    ended = False

    def watch() -> None:
        status = process.wait()
        if not ended:
            logger.error(
                "FLEET: the worker ended with status %d, so this arm takes no more jobs. The "
                "server still runs. To start a worker, type: armtree fleet join --server %s "
                "--fleet %s --pool %s --name %s --page %s",
                *(status, server, place.url, place.pool, place.name, page),
            )

    RealClock().spawn(watch, "fleet worker")
    assert process.stdin
    try:
        yield
    finally:
        ended = True
        process.stdin.close()
        try:
            process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
