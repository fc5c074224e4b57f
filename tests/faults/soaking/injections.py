"""Faults of a soak, each injected for real into the running server or its board."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.faults.process import kill
from tests.faults.rows.server import HOSTILE

from .clients import pause
from .site import Site


def unplug(site: Site, random: random.Random) -> None:
    site.spoiled += 1
    site.board.ask("unplug")
    site.plugged = False


def stall(site: Site, random: random.Random) -> None:
    """The board reads nothing for a while; the reader of the messages lets it go on."""
    site.spoiled += 1
    site.board.ask("stall")


def noise(site: Site, random: random.Random) -> None:
    site.board.ask(f"garbage {random.choice([1, 100, 4000])} {random.random()}")


def words(site: Site, random: random.Random) -> None:
    site.board.ask("send " + random.choice(["hello", "k0001,00,00,0000", "armtree 1 ?", "status"]))


def reset(site: Site, random: random.Random) -> None:
    site.board.ask("reset")


def wrong_writes(site: Site, random: random.Random) -> None:
    """The kernel refuses writes to the port, takes long, or takes a part."""
    site.spoiled += 1
    how = ["errno 5", "errno 19 once", "errno 11", "delay 40", "delay 4000 once", "hang 200"]
    site.calls.start(random.choice([*how, "zero", "zero once", "short 7", "short 1"]))
    pause(random, 2.0)
    if random.random() < 0.7:
        site.calls.stop()


def slow_disk(site: Site, random: random.Random) -> None:
    """Writes of recordings take long for a while, up to too long."""
    site.disk_spoiled = True
    site.spoiled += 1
    site.disk.start(f"delay {random.choice([50, 300, 1000, 8000])}")
    pause(random, 4.0)
    site.disk.stop()


def failing_disk(site: Site, random: random.Random) -> None:
    """A write or a sync of a recording fails: no space, or an error of the disk."""
    site.disk_spoiled = site.disk_failed = True
    site.spoiled += 2  # the frame whose recording failed, and the hold
    random.choice([site.disk, site.sync]).start(random.choice(["errno 28", "errno 5 once"]))
    pause(random, 2.0)
    for each in (site.disk, site.sync):
        each.stop()


def flood(site: Site, random: random.Random) -> None:
    """Hostile clients for a while, which need no token."""
    kind = random.choice(["connections", "long cancels", "foreign stops", "chunks", "huge bodies"])
    line = [sys.executable, str(HOSTILE), kind, str(site.server.address[1]), "40"]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, start_new_session=True) as crowd:
        pause(random, 4.0)
        crowd.kill()


def worker(site: Site, random: random.Random) -> None:
    """A process of the server is killed, or stops."""
    family = site.server.family()
    if family:
        kill(random.choice(family), random.choice([signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM]))


def freeze(site: Site, random: random.Random) -> None:
    """The server does not run for a moment, as on a machine that sleeps."""
    kill(site.server.pid, signal.SIGSTOP)
    begin = time.monotonic()
    try:
        pause(random, 3.0)
    finally:
        site.frozen.append((begin, time.monotonic()))
        kill(site.server.pid, signal.SIGCONT)


def busy(site: Site, random: random.Random) -> None:
    """Other programs take the processors for a moment, shorter than a frame may wait."""
    script = "import time; end = time.monotonic() + 3\nwhile time.monotonic() < end: pass"
    line = [sys.executable, "-I", "-c", script]
    # Linux schedules sessions, so each gets as much as the server.
    others = [subprocess.Popen(line, start_new_session=True) for _ in range(random.randint(2, 6))]
    for other in others:
        other.wait()


def stopped(pid: int) -> bool:
    """Whether a process is stopped."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    except OSError:
        return False


def restart_stopped(site: Site) -> None:
    """Let processes of the server go on that the soak has stopped."""
    for pid in site.server.family():
        if stopped(pid):
            kill(pid, signal.SIGCONT)


INJECTIONS: tuple[tuple[Callable[[Site, random.Random], None], int], ...] = (
    (unplug, 3),
    (stall, 2),
    (noise, 1),
    (words, 1),
    (reset, 1),
    (wrong_writes, 3),
    (worker, 3),
    (freeze, 1),
    (slow_disk, 2),
    (failing_disk, 1),
    (flood, 2),
    (busy, 1 if len(os.sched_getaffinity(0)) > 1 else 0),
)
OF_THE_BOARD = (unplug, stall, noise, words, reset)
