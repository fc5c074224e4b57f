"""Use one server for an hour: clients come and go, faults come, a person recovers the arm.

The time is cut into rounds. In a round, clients and faults act at random. Then all of them end, a
person gets the arm to move again by the messages alone, and everything is counted: memory,
descriptors, threads, processes. The recordings of the round are verified, and compared with what
the board has read. Ends with 1 if something does not hold. README.md says more.
"""

import argparse
import contextlib
import dataclasses
import json
import os
import random
import shutil
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[0] = str(ROOT)  # in place of this folder

from tests.faults.machine import Busy, measured  # noqa: E402
from tests.faults.process import INTERRUPTED, Hang, until  # noqa: E402
from tests.faults.row import Scene  # noqa: E402
from tests.faults.run import PAGE, SOAK, allowed, described, percentile_99  # noqa: E402
from tests.faults.soaking import person  # noqa: E402
from tests.faults.soaking.clients import ACTS, pause  # noqa: E402
from tests.faults.soaking.figures import WARM, Sample, ends, growth, header, line  # noqa: E402
from tests.faults.soaking.injections import (  # noqa: E402
    INJECTIONS,
    OF_THE_BOARD,
    restart_stopped,
)
from tests.faults.soaking.site import Site  # noqa: E402

CLIENTS = 3
ROUND_S = 30.0
HOUR = 60.0  # [minutes]
GROWING = {"memory": " [MiB]", "descriptors": "", "threads": "", "processes": ""}
STOP_MS = 50  # 99th percentile of the time that a stop takes


class Soak:
    """A soak under way."""

    def __init__(self, site: Site, seed: str) -> None:
        self.site, self.random, self.seed = site, random.Random(seed), seed
        self.begin = time.monotonic()
        self.samples: list[Sample] = []
        self.faults: Counter[str] = Counter()
        self.acts: Counter[str] = Counter()
        self.recoveries = 0
        self._round = 0

    def round(self, seconds: float) -> Sample:
        """Let clients and faults act for so long, then end all of it, and count."""
        self._round += 1
        stop = threading.Event()
        clients = [
            threading.Thread(target=self._act, args=(stop, f"{self.seed} {self._round} {number}"))
            for number in range(CLIENTS)
        ]
        for client in clients:
            client.start()
        end = time.monotonic() + seconds
        while time.monotonic() < end and not INTERRUPTED.is_set():
            pause(self.random, 6.0)
            self._inject()
            pause(self.random, 3.0)
            if self.random.random() < 0.7:
                self._recover(strict=False)
        stop.set()
        for client in clients:
            client.join(150)
            if client.is_alive():
                self.site.problem("an act of a client does not end")
        if not INTERRUPTED.is_set():
            self._quiet()
        return self._count()

    def _act(self, stop: threading.Event, seed: str) -> None:
        own = random.Random(seed)
        acts, weights = zip(*ACTS, strict=True)
        while not (stop.is_set() or INTERRUPTED.is_set()):
            (act,) = own.choices(acts, weights)
            self.acts[act.__name__] += 1
            self._guarded(act.__name__, lambda act=act: act(self.site, own))  # type: ignore[misc]
            pause(own, 2.0)

    def _inject(self) -> None:
        faults, weights = zip(*INJECTIONS, strict=True)
        (fault,) = self.random.choices(faults, weights)
        if not self.site.plugged and fault in OF_THE_BOARD:
            return
        self.faults[fault.__name__] += 1
        self._guarded(fault.__name__, lambda: fault(self.site, self.random))

    def _recover(self, strict: bool) -> None:
        def work() -> None:
            self.recoveries += person.works(self.site, strict)

        self._guarded("a recovery", work)

    def _guarded(self, name: str, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # it is a finding, and the soak goes on
            self.site.problem(f"{name}: {type(error).__name__}: {error}")

    def _quiet(self) -> None:
        """End everything, and get the arm to move by what the messages say."""
        site = self.site
        restart_stopped(site)
        self._guarded("stop", site.end_goals)
        self._recover(strict=True)
        self._guarded("stop", site.end_goals)
        site.repair()
        with contextlib.suppress(Hang):  # then the figures show it
            until("quiet", self._settled, 15)
        self._guarded("compare", site.compare)
        self._guarded("verify", site.verify)
        site.tracebacks()

    def _settled(self) -> bool:
        """Whether nothing changes for a second."""
        before = self._figures()[2:]
        time.sleep(1.0)  # noqa: TID251
        return before == self._figures()[2:]

    def _figures(self) -> tuple[float, float, int, int, int]:
        server = self.site.server
        family = server.family()
        total = 0.0
        for pid in family:
            with contextlib.suppress(OSError):
                pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
                total += pages * os.sysconf("SC_PAGE_SIZE") / 2**20
        return server.memory(), total, server.descriptors(), server.threads(), len(family)

    def _count(self) -> Sample:
        memory, family, descriptors, threads, processes = self._figures()
        site = self.site
        sample = Sample(
            minute=round((time.monotonic() - self.begin) / 60, 1),
            goals=site.verified,
            faults=self.faults.total(),
            recoveries=self.recoveries,
            memory=round(memory, 1),
            family=round(family, 1),
            descriptors=descriptors,
            threads=threads,
            processes=processes,
            frames=len(site.board.frames()),
            unreceived=site.unreceived,
            problems=len(site.problems),
        )
        self.samples.append(sample)
        return sample

    def judge_stops(self, busy: Busy) -> None:
        """It is a problem if stops took too long for a machine that was so busy before."""
        most = allowed(STOP_MS, "ms", busy)
        if self.site.stops and (p99 := 1000 * percentile_99(self.site.stops)) > most:
            self.site.problem(f"of the stops, 1 % took {p99:.0f} ms; the limit is {most:.0f} ms")

    def end(self) -> None:
        """End the server as Ctrl-C does; verify what is left."""
        site = self.site
        if (status := site.server.popen.poll()) is not None:
            site.problem(f"the server ended by itself, with {status}")
            return
        family = site.server.family()
        site.server.signal(signal.SIGINT)
        allowed = (0, 10) if site.disk_failed else (0,)
        if (status := site.server.wait()) not in allowed:
            words = site.server.errors.read_text(errors="replace")[-300:]
            site.problem(f"the server ends with {status}: {words!r}")
        if left := [pid for pid in family if Path(f"/proc/{pid}").exists()]:
            site.problem(f"processes {left} outlive the server")
        site.tracebacks()
        self._guarded("compare", site.compare)
        self._guarded("verify", lambda: site.verify(last=True))


def report(soak: Soak, busy: Busy) -> dict[str, Any]:
    """Everything that was found, for `--json`."""
    site, stops = soak.site, soak.site.stops
    return {
        "seed": soak.seed,
        "server": site.words,
        "minutes": soak.samples[-1].minute if soak.samples else 0.0,
        "held": not site.problems,
        "problems": site.problems,
        "recordings": site.verified,
        "incomplete": site.incomplete,
        "recorded_mb": round(site.recorded_bytes / 1e6, 1),
        "stop_ms": {
            "times": len(stops),
            "median": round(1000 * statistics.median(stops), 1) if stops else None,
            "p99": round(1000 * percentile_99(stops), 1) if stops else None,
            "worst": round(1000 * max(stops), 1) if stops else None,
            "machine": round(1000 * busy.delay, 1),
        },
        "acts": dict(soak.acts.most_common()),
        "faults": dict(soak.faults.most_common()),
        "codes": dict(site.codes.most_common()),
        "samples": [dataclasses.asdict(sample) for sample in soak.samples],
    }


def section(found: Mapping[str, Any]) -> str:
    """The last section of the page of faults: what was seen in this soak."""
    samples = [Sample(**each) for each in found["samples"]]
    last, stops = samples[-1], found["stop_ms"]
    warm = samples[int(WARM * len(samples)) :]
    rows = {
        "acts of clients": sum(found["acts"].values()),
        "faults": last.faults,
        "times that a person brought the arm back": last.recoveries,
        "recordings that were verified": found["recordings"],
        "recordings that a failing disk cut off": found["incomplete"],
        "problems": len(found["problems"]),
        "stops": f"{stops['times']}: median {stops['median']} ms, 99 % {stops['p99']} ms (at most"
        f" {STOP_MS} ms, and {stops['machine']} ms more on this machine), worst {stops['worst']}"
        " ms",
        **{
            f"{name} of the server{unit}": "{:g}, then {:g}; {:g} at the end".format(
                *ends(warm, name)
            )
            for name, unit in GROWING.items()
        },
    }
    lines = [
        "`make soak` uses one server for an hour. Three clients act at random, and faults come at"
        " random. Every half minute everything ends, and the arm must move again after what the"
        " messages say. The first quarter of the time warms the server. Of the rest, the table has"
        " the median of the first and of the last quarter, and the last value.",
        "",
        f"{found['minutes']:.0f} minutes, seed {found['seed']}, {found['server']}, {described()}.",
        "",
        "| figure | seen |",
        "|---|---|",
        *(f"| {name} | {value} |" for name, value in rows.items()),
    ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status 0 if everything held, 130 after Ctrl-C or SIGTERM."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, help="default: 60, and the page is written")
    parser.add_argument("--seed", default=str(random.randrange(10**6)))
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--keep", action="store_true", help="keep the folder in any case")
    parser.add_argument("--page", action="store_true", help="write docs/faults.md in any case")
    given = parser.parse_args(arguments)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: INTERRUPTED.set())  # then nothing waits any more
    folder = Path(tempfile.mkdtemp(prefix="armtree-soak-"))
    scene, busy = Scene(folder, given.seed), measured()
    try:
        site = Site(scene)
        soak = Soak(site, given.seed)
        say(f"seed {given.seed}, folder {folder}, {site.words}")
        reported = use(soak, 60 * (given.minutes or HOUR), busy)
    except Hang:
        if not INTERRUPTED.is_set():
            raise
    finally:
        scene.finish()
    if INTERRUPTED.is_set():  # what it has cut off is no finding
        shutil.rmtree(folder, ignore_errors=True)
        return 130
    found = report(soak, busy)
    if given.page or given.minutes is None:
        PAGE.write_text(PAGE.read_text().partition(SOAK)[0] + SOAK + "\n" + section(found))
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))
    for problem in site.problems[reported:]:
        say(f"    {problem}")
    for name in ("acts", "faults", "codes", "stop_ms"):
        words = ", ".join(f"{key} {value}" for key, value in found[name].items())
        say(f"{name}: {words}")
    say(f"{site.verified} recordings, {len(site.problems)} problems, seed {given.seed}")
    if not (site.problems or given.keep):
        site.remove()
    return int(bool(site.problems))


def use(soak: Soak, seconds: float, busy: Busy) -> int:
    """Use a site for so long, and print each round; return how many problems were printed."""
    site, end, reported = soak.site, soak.begin + seconds, 0
    say(header())
    person.works(site)
    while site.server.popen.poll() is None:
        sample = soak.round(min(ROUND_S, max(5.0, end - time.monotonic())))
        if INTERRUPTED.is_set():
            return 0
        say(line(sample))
        for problem in site.problems[reported:]:
            say(f"    {problem}")
        reported = len(site.problems)
        if time.monotonic() > end:
            break
    site.problems += growth(soak.samples)
    soak.judge_stops(busy)
    soak.end()
    return reported


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
