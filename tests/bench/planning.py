"""Planning time, duration and safety of plans, compared with other planners.

Our planner and all others that can be installed, each in its own environment, get the same queries
in the same run: two straight motions and one around a block, on three simple axes; random pairs on
the shipped arm, alone and near a post; random pairs among posts on six and seven axes. All keep the
same margin, and one reference checker checks all motions every millisecond. Then ours only: motions
with via points and the rest of stopped motions, checked the same way; goals in a shelf, and
MotionBenchMaker's problems, which are cloned beside the other planners' environments; growth of the
cost, overhead of a worker, time to stop it, and memory leaks. `--quick` uses fewer queries.
Another planner that needs more than five minutes for a problem is stopped.
"""

import os
import statistics
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

# If this file is run as a script, its folder is first, and holds files named like the rooms.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]
sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hardware import load_robot
from tests.bench.planners import clutter, mesh_arms, narrow
from tests.bench.planners.compared_planners import PEERS, Score, installed, ours, peer
from tests.bench.planners.continued_motions import score_continued
from tests.bench.planners.growth import Growth, growths
from tests.bench.planners.problems import Problem, fixed, random
from tests.bench.planners.worker_pool import deadlines, growth_mb, overheads, poison
from tests.bench.table import Row, arguments, show

_LINE = "{:<9} {:<18} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n"
_HEAD = (
    "problem",
    "stack",
    "solved",
    "p50 ms",
    "p95 ms",
    "detours",
    "ratio",
    "colliding",
    "excess",
)


def table(problems: Sequence[Problem], peers: dict[str, Path], folder: Path) -> Iterator[Score]:
    """Run every planner on every problem, and print each score. The folder is for their files."""
    sys.stdout.write(_LINE.format(*_HEAD))
    for problem in problems:
        yield _shown(ours(problem))
        for name, venv in peers.items():
            try:
                yield _shown(peer(name, venv, problem, folder))
            except RuntimeError as error:
                sys.stdout.write(f"{problem.name:<9} {name}: FAILED: {error}\n")


def _shown(score: Score) -> Score:
    figures = (f"{x:.3f}" for x in (score.p(50), score.p(95)))
    solved = f"{len(score.spent)}/{score.queries}"
    rest = (len(score.detours), f"{score.ratio():.4f}", score.colliding, f"{score.worst():.4f}")
    sys.stdout.write(_LINE.format(score.problem, score.stack, solved, *figures, *rest))
    sys.stdout.flush()
    return score


def grown(count: int, folder: Path) -> Iterator[Growth]:
    """Measure how our cost grows, and print each result."""
    for growth in growths(count, folder):
        each = zip(growth.counts, growth.spent, growth.solved, growth.searched, strict=True)
        for n, ms, solved, searched in each:
            text = f"{ms:9.3f} ms, {ms / growth.spent[0]:6.2f} times, {solved} of {count}"
            sys.stdout.write(f"{n:>3} {growth.what:<6} {text}, {searched} of them searched\n")
        yield growth


def rows(
    runs: Sequence[dict[str, Score]], quick: bool, folder: Path, overhead: Row
) -> Iterator[Row]:
    """Yield the figures that the project commits to. Arms are written into a folder."""
    last, robot = runs[-1], load_robot()
    own = list(last.values())
    for name, problem, share in (
        ("straight_p50_ms", "bare", 50),
        ("straight_p95_ms", "bare", 95),
    ):
        yield Row(name, "ms", [run[problem].p(share) for run in runs])
    for name, problem, share in (
        ("detour_p50_ms", "hard", 50),
        ("detour_p95_ms", "hard", 95),
        ("post_detour_p50_ms", "post", 50),
        ("post_detour_p95_ms", "post", 95),
    ):
        yield Row(name, "ms", [run[problem].detour(share) for run in runs])
    yield Row("obstacle_duration_ratio", "1", [last["post"].ratio()])
    yield Row("solved", "1", [sum(len(s.spent) for s in own) / sum(s.queries for s in own)])
    yield Row("colliding", "", [sum(score.colliding for score in own)])
    yield Row("limit_excess", "1", [max(score.worst() for score in own)])
    continued = score_continued(random(10 if quick else 100))
    yield Row("onward_colliding", "", [continued.colliding])
    yield Row("onward_excess", "1", [max(continued.over)])
    yield Row("seven_axis_success", "1", [len(last["seven"].spent) / last["seven"].queries])
    yield overhead
    late, canceled, again = deadlines(robot, 10 if quick else 50, folder)
    yield Row("past_deadline_ms", "ms", late)
    yield Row("cancel_ms", "ms", canceled)
    yield Row("next_after_kill_ms", "ms", again)
    yield Row("poison_ms", "ms", list(poison(robot)))
    arms, count = mesh_arms.arms(folder), 10 if quick else 100
    so101 = list(mesh_arms.spent(load_robot(Path("so101")), 3 * count))
    yield Row("so101_p50_ms", "ms", [statistics.median(so101)])
    yield Row("mesh_poison_ms", "ms", [x for arm in arms for x in mesh_arms.poison(arm, count)])
    yield Row(
        "mesh_past_deadline_ms", "ms", [x for arm in arms for x in mesh_arms.late(arm, count)]
    )
    yield from narrow_rows(folder, 5 if quick else 30)
    yield Row("growth_10k_plans_mb", "MB", [growth_mb(robot, 1_000 if quick else 10_000)])


def narrow_rows(folder: Path, count: int) -> Iterator[Row]:
    """Yield the figures of goals in a shelf, each with a sample for each arm."""
    scores = list(narrow.scores(folder, count))
    yield Row("narrow_solved", "1", [len(score.spent) / score.queries for score in scores])
    medians = [statistics.median(score.spent) for score in scores if score.spent]
    yield Row("narrow_p50_ms", "ms", medians)


def clutter_rows(problems: Path, folder: Path, count: int) -> Iterator[Row]:
    """Yield the figures of MotionBenchMaker's problems, and of collision checks in its scenes."""
    found = clutter.score(problems, count, folder)
    yield Row("clutter_solved", "1", [len(found.spent) / found.queries])
    yield Row("clutter_p50_ms", "ms", [float(np.percentile(found.spent, 50))])
    yield Row("clutter_p95_ms", "ms", [float(np.percentile(found.spent, 95))])
    yield Row("clutter_duration_s", "s", [statistics.fmean(found.durations)])
    yield Row("clutter_colliding", "", [found.colliding])
    rates = list(clutter.rates(problems, folder))
    yield Row("configurations_per_s", "1/s", [ours for ours, _ in rates])
    yield Row("coal_alone_per_s", "1/s", [coal for _, coal in rates])


def draw(scores: Sequence[Score], growths: Sequence[Growth], file: Path) -> None:
    """Draw the cost of every planner on every problem, and the growth of ours."""
    figure = Figure(figsize=(11.0, 4.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    times, longer, growing = figure.subplots(1, 3)
    names = list(dict.fromkeys(score.problem for score in scores))
    for stack in dict.fromkeys(score.stack for score in scores):
        mine = [score for score in scores if score.stack == stack and score.spent]
        across = [names.index(score.problem) for score in mine]
        label = f"{stack} (timing only)" if stack.startswith("ruckig") else stack
        times.plot(across, [score.p(50) for score in mine], "o-", label=label, markersize=4)
        longer.plot(across, [score.ratio() for score in mine], "o-", label=stack, markersize=4)
        hits = [score for score in mine if score.colliding]
        at = [names.index(score.problem) for score in hits]
        longer.plot(at, [score.ratio() for score in hits], "rx", markersize=9)
    for growth in growths:
        counts = [n / growth.counts[0] for n in growth.counts]
        label = f"{growth.what}, from {growth.counts[0]}"
        growing.loglog(counts, [ms / growth.spent[0] for ms in growth.spent], "o-", label=label)
    times.set_yscale("log")
    for axes, title in (
        (times, "time to a plan, median [ms]"),
        (longer, "duration over the straight line's\n(red cross: some of them collide)"),
        (growing, "armtree's cost, times that of the first"),
    ):
        axes.set_title(title, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
    for axes in (times, longer):
        axes.set_xticks(range(len(names)), names)
    growing.set_xlabel("times as many", fontsize=8)
    times.legend(fontsize=7)
    growing.legend(fontsize=7)
    figure.savefig(file)


def main() -> None:
    """Measure and show."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--quick", action="store_true", help="30 pairs instead of 300, and so on")
    parser.add_argument("--no-peers", action="store_true", help="our planner only")
    parser.add_argument(
        "--clutter",
        type=int,
        default=10,
        metavar="N",
        help="problems of each of MotionBenchMaker's seven scenes (default: %(default)s; 100: all "
        "699, which take a quarter of an hour)",
    )
    parser.add_argument("--plot", type=Path, default=Path("planning.png"), metavar="PNG")
    parser.add_argument(
        "--environments",
        type=Path,
        default=Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "armtree-peers",
        metavar="DIR",
        help="folder of the other planners' environments, 1.5 GB (default: %(default)s)",
    )
    given = parser.parse_args()
    wanted = {} if given.no_peers else PEERS
    found = {name: installed(name, given.environments, sys.stdout.write) for name in wanted}
    peers = {name: venv for name, venv in found.items() if venv}
    problems = [*fixed(12), *random(30 if given.quick else 300)]
    # First, while as little is in memory as in the process that runs a task.
    count = 100 if given.quick else 500
    overhead = Row("worker_overhead_ms", "ms", overheads(load_robot(), count))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scores = list(table(problems, peers, folder))
        growing = list(grown(10 if given.quick else 50, folder))
        runs = [{score.problem: score for score in scores if score.stack == "armtree"}]
        for _ in range(given.runs - 1):
            again = {problem.name: ours(problem) for problem in problems if problem.name != "seven"}
            runs.append({**runs[0], **again})
        draw(scores, growing, given.plot)
        figures = list(rows(runs, given.quick, folder, overhead))
        if scenes := clutter.checkout(given.environments, sys.stdout.write):
            figures += clutter_rows(scenes, folder, given.clutter)
    figures += [Row(f"{g.what}_10x", "1", [g.spent[-1] / g.spent[0]]) for g in growing]
    show(figures, given.json)
    sys.stdout.write(f"{given.plot}\n")


if __name__ == "__main__":
    main()
