"""What `make faults` runs: every fault of a table, for real, against the command as a user runs it.

Ends with 1 if a row does not hold. README.md says how to write a row.
"""

import argparse
import concurrent.futures
import contextlib
import dataclasses
import functools
import importlib
import itertools
import json
import math
import os
import platform
import random
import shutil
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[0] = str(ROOT)  # in place of this folder

from tests.faults.machine import Busy, measured  # noqa: E402
from tests.faults.process import INTERRUPTED  # noqa: E402
from tests.faults.row import Row, Scene, inject, verify  # noqa: E402

HERE = Path(__file__).parent
PAGE = ROOT / "docs" / "faults.md"
SOAK = "\n## Soak\n"  # the last section of the page
JOBS = 3


@dataclasses.dataclass(frozen=True)
class Finding:
    """What came of a row. Figures are in its unit.

    Attributes:
        delay: By how much an idle program woke too late before, 99th percentile [ms].
        slowdown: Runnable threads per processor before, at least 1.
        means: By which means the fault was injected, if that depends on the machine.
    """

    row: str
    fault: str
    times: int
    held: bool
    promise: str
    limit: float | None
    median: float | None
    p99: float | None
    worst_limit: float | None
    worst: float | None
    unit: str
    delay: float
    slowdown: float
    seconds: float
    problems: Sequence[str]
    means: Sequence[str]


def rows() -> list[Row]:
    """All rows, in the order of the files and of the lines."""
    names = sorted(path.stem for path in (HERE / "rows").glob("*.py"))
    modules = [importlib.import_module(f"tests.faults.rows.{name}") for name in names]
    return [each for one in modules for each in vars(one).values() if isinstance(each, Row)]


def examine(one: Row, times: int, seed: int, folder: Path, keep: bool, busy: Busy) -> Finding:
    """Inject a row's fault so often, at times that follow from the seed, the row and the number.

    `busy` is of the machine before the first fault.
    """
    begin = time.monotonic()
    scenes = [
        inject(one, folder / f"{one.name}-{number}", f"{seed} {one.name}", number)
        for number in range(times)
    ]
    if asked := [scene for scene in scenes if scene.verdicts]:
        verifying = dataclasses.replace(one, inject=functools.partial(verify, asked))
        scenes.append(inject(verifying, folder / f"{one.name}-verify", ""))
    seconds = time.monotonic() - begin
    for scene in scenes:
        if not (keep and scene.problems):
            shutil.rmtree(scene.folder, ignore_errors=True)
    return found(one, scenes, seconds, busy)


def allowed(limit: float | None, unit: str, busy: Busy) -> float:
    """The limit on a machine that was so busy: a reaction is later, and work takes longer.

    At most it is doubled. A row that needs more says nothing, and does not hold.
    """
    if limit is None:
        return math.inf
    extended = {"ms": limit + 1000 * busy.delay, "s": limit * busy.slowdown}.get(unit, limit)
    return min(extended, 2 * limit)


def percentile_99(figures: Iterable[float]) -> float:
    """The 99th percentile: of up to 99 figures, the largest."""
    ordered = sorted(figures)
    return ordered[-(-99 * len(ordered) // 100) - 1]


def found(one: Row, scenes: Iterable[Scene], seconds: float, busy: Busy) -> Finding:
    """Sum up the injections of a row."""
    scenes = list(scenes)
    problems = [f"{scene.folder.name}: {each}" for scene in scenes for each in scene.problems]
    kinds = defaultdict[str, list[float]](list)
    for kind, value in itertools.chain.from_iterable(scene.figures for scene in scenes):
        kinds[kind].append(value)
    figures = sorted(itertools.chain.from_iterable(kinds.values()))
    p99 = max(map(percentile_99, kinds.values()), default=None)  # few figures of a kind count, too
    worst = figures[-1] if figures else None
    if (one.limit or one.worst) is not None and p99 is None:
        problems.append("no figure")
    slow = any(
        seen is not None and seen > allowed(most, one.unit, busy)
        for most, seen in ((one.limit, p99), (one.worst, worst))
    )
    return Finding(
        row=one.name,
        fault=one.fault,
        times=sum(scene.injections for scene in scenes),
        held=not (problems or slow),
        promise=one.promise,
        limit=one.limit,
        median=statistics.median(figures) if figures else None,
        p99=p99,
        worst_limit=one.worst,
        worst=worst,
        unit=one.unit,
        delay=1000 * busy.delay,
        slowdown=busy.slowdown,
        seconds=seconds,
        problems=problems,
        means=sorted(set[str]().union(*(scene.means for scene in scenes))),
    )


def figure(value: float | None, unit: str) -> str:
    return "" if value is None else f"{float(f'{value:.3g}'):g} {unit}".strip()


def cells(each: Finding) -> list[str]:
    """A line of the table."""
    verdict = "held" if each.held else "NOT HELD"
    figures = each.limit, each.p99, each.worst
    seen = [figure(value, each.unit) for value in figures]
    return [each.row, str(each.times), verdict, *seen, slack(each)]


def slack(each: Finding) -> str:
    """What the limit of a row was extended by."""
    words = {"ms": f"{each.delay:.1f} ms more", "s": f"{each.slowdown:.1f} times"}
    return "" if each.limit is None else words.get(each.unit, "")


HEADER = ["row", "times", "held", "promised", "p99 seen", "worst", "machine"]


def line(texts: Sequence[str]) -> str:
    widths = (30, 6, 8, 12, 12, 12, 12)
    return "  ".join(text.ljust(width) for text, width in zip(texts, widths, strict=True))


def page(findings: Sequence[Finding], seed: int, seconds: float) -> str:
    """The page of the documentation, with the section that `soak.py` has written."""
    lines = (HERE / "page.md").read_text().splitlines()
    lines += [
        "",
        f"{len(findings)} rows, seed {seed}, {seconds / 60:.0f} minutes, {described()}.",
        "",
        "| row | fault | what must hold | times | held | promised | machine | median | 99 % |"
        " worst |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for each in findings:
        seen = [figure(value, each.unit) for value in (each.median, each.p99, each.worst)]
        fault = "; here by ".join([each.fault, *each.means])
        texts = [f"`{each.row}`", fault, each.promise, str(each.times)]
        limit = promised(each.limit, each.worst_limit, each.unit)
        texts += ["yes" if each.held else "**no**", limit, slack(each), *seen]
        lines.append("| " + " | ".join(texts) + " |")
    return "\n".join(lines) + "\n" + "".join(PAGE.read_text().partition(SOAK)[1:])


def promised(limit: float | None, worst: float | None, unit: str) -> str:
    """The limits of a row in words."""
    limits = [(limit, " (99 %)" if worst else ""), (worst, " (worst)")]
    texts = [figure(most, unit) + of for most, of in limits if most is not None]
    return f"at most {', '.join(texts)}" if texts else ""


def described() -> str:
    """The machine in a few words, with its load."""
    load, cores = os.getloadavg()[1], len(os.sched_getaffinity(0))
    kernel = platform.release().partition("-")[0]
    return f"{cores} cores, {platform.system()} {kernel}, load average {load:.1f}"


def examined(
    chosen: Sequence[tuple[Row, int]],
    seed: int,
    folder: Path,
    keep: bool,
    jobs: int,
) -> list[Finding]:
    """Examine the rows, some at the same time, and print each when it is done.

    The machine is measured while no row runs. The main thread, which a signal interrupts, starts
    no row itself: it could be interrupted between the start of a process and the note of it.
    """
    printing = threading.Lock()

    def work(one: Row, times: int, busy: Busy) -> Finding:
        finding = examine(one, times, seed, folder, keep, busy)
        with printing:
            sys.stdout.write(line(cells(finding)).rstrip() + "\n")
            for words in (*(f"by {each}" for each in finding.means), *finding.problems[:5]):
                sys.stdout.write(f"    {words}\n")
            sys.stdout.flush()
        return finding

    done: dict[str, Finding] = {}
    kind = concurrent.futures.ThreadPoolExecutor
    with kind(jobs) as pool, kind(1) as waiting:
        try:
            busy = measured()
            together = [
                (waiting if each[0].waits else pool).submit(work, *each, busy)
                for each in chosen
                if not each[0].alone
            ]
            done.update((future.result().row, future.result()) for future in together)
            for one, times in chosen:
                if one.alone:
                    done[one.name] = pool.submit(work, one, times, measured()).result()
        except KeyboardInterrupt:
            for each in (pool, waiting):
                each.shutdown(wait=False, cancel_futures=True)
            raise
    return [done[one.name] for one, _ in chosen]


def interrupt(*_: object) -> None:
    """End what runs, with all that it has started."""
    INTERRUPTED.set()  # Python drops an exception that is raised during a fork
    raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status 0 if every row held."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", metavar="ROW", action="append", default=[])
    parser.add_argument("--times", type=int, metavar="N", help="injections per row")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    parser.add_argument("--quick", action="store_true", help="a selection, half a minute")
    parser.add_argument("--keep", action="store_true", help="keep the folders of what failed")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--page", type=Path, metavar="FILE", help="default: docs/faults.md")
    parser.add_argument(
        "--jobs", type=int, default=JOBS, help="rows at the same time, beside one that waits"
    )
    parser.add_argument("--list", action="store_true", help="list the rows and end")
    given = parser.parse_args(arguments)
    known = rows()
    if unknown := set(given.only) - {one.name for one in known}:
        parser.error(f"no row {', '.join(sorted(unknown))}; --list lists them")
    part = given.only or given.times or given.quick
    if given.page and part:
        parser.error("a page is of all rows; leave out --only, --times and --quick")
    if given.list:
        sys.stdout.writelines(f"{one.name:28}  {one.fault}\n" for one in known)
        return 0
    wanted = [one for one in known if not given.only or one.name in given.only]
    chosen = [
        (one, given.times or (one.quick if given.quick else one.times))
        for one in wanted
        if one.quick or not given.quick
    ]
    if not chosen:
        parser.error("no row is left; --list lists them")
    begin, folder = time.monotonic(), Path(tempfile.mkdtemp(prefix="armtree-faults-"))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)
    sys.stdout.write(f"seed {given.seed}, folder {folder}, {described()}\n{line(HEADER)}\n")
    try:
        findings = examined(chosen, given.seed, folder, given.keep, given.jobs)
    finally:
        if not any(folder.iterdir()):
            folder.rmdir()
    seconds = time.monotonic() - begin
    failed = [each.row for each in findings if not each.held]
    sys.stdout.write(f"{len(findings) - len(failed)} of {len(findings)} rows held, ")
    sys.stdout.write(f"{seconds:.0f} s, seed {given.seed}\n")
    if given.json:
        given.json.write_text(json.dumps([dataclasses.asdict(one) for one in findings], indent=1))
    if not part:
        (given.page or PAGE).write_text(page(findings, given.seed, seconds))
    return int(bool(failed))


if __name__ == "__main__":
    status = 130
    with contextlib.suppress(KeyboardInterrupt):
        status = main()
    sys.exit(130 if INTERRUPTED.is_set() else status)
