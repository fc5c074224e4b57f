"""Planning time, duration and safety of plans, compared with other planners.

Our planner and all others that can be installed, each in its own environment, get the same queries
in the same run: two straight motions and one around a block, on three simple axes; random pairs on
the shipped arm, alone and near a post; random pairs among posts on six and seven axes. One
reference checker checks all motions every millisecond. roboplan also gets the goals in a shelf, and
all but ruckig get some of MotionBenchMaker's problems, which are cloned beside their environments.
VAMP gets only these, because it is compiled for a few arms. pip compiles it, which needs a C++
compiler and downloads sources.

All keep the same margin. The others have none, so shapes are padded for them, and a mesh is its
bounding box. In a shelf and in MotionBenchMaker's problems a mesh stays a mesh, which cannot be
padded. There the world is padded by the whole margin, and the others keep no distance between two
links of the arm: the problems are easier for them.

The rest is ours only: motions with via points and the rest of stopped motions, checked the same
way; random scenes, which `--seed` chooses, checked without any of our code; large worlds that
change a little; growth of the cost, overhead of a worker, time to stop it, and memory leaks.
`--quick` uses fewer queries, and `--only` measures some rows. Another planner that needs more than
five minutes for a problem is stopped.
"""

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

# If this file is run as a script, its folder is first, and holds files named like the rooms.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]
sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hardware import Robot, load_robot
from tests.bench.planners import changed_worlds, clutter, held_out, mesh_arms, narrow, room
from tests.bench.planners.compared_planners import PEERS, Score, installed, ours, peer
from tests.bench.planners.continued_motions import score_continued
from tests.bench.planners.growth import Growth, growths
from tests.bench.planners.problems import Problem, fixed, random
from tests.bench.planners.worker_pool import deadlines, growth_mb, overheads, poison
from tests.bench.table import Row, arguments, show

_COMPARED = (
    "straight_p50_ms straight_p95_ms detour_p50_ms detour_p95_ms post_detour_p50_ms "
    "post_detour_p95_ms obstacle_duration_ratio solved colliding limit_excess seven_axis_success "
    "axes_10x boxes_10x legs_10x"
)
_CLUTTER = (
    "clutter_solved clutter_p50_ms clutter_p95_ms clutter_bookshelf clutter_box clutter_cage "
    "clutter_table clutter_duration_s clutter_kept_margin clutter_duration_ratio "
    "configurations_per_s coal_alone_per_s"
)
_FOR_PEERS = 3  # problems of each scene: each takes the others' processes seconds to start
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
            if name == "vamp_planner":
                continue  # it knows none of these arms
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


def compared_rows(given: argparse.Namespace, peers: dict[str, Path], folder: Path) -> Iterator[Row]:
    """Yield the figures of the problems that all planners get, and of growth."""
    problems = [*fixed(12), *random(30 if given.quick else 300)]
    scores = list(table(problems, peers, folder))
    growing = list(grown(10 if given.quick else 50, folder))
    runs = [{score.problem: score for score in scores if score.stack == "armtree"}]
    for _ in range(given.runs - 1):
        again = {problem.name: ours(problem) for problem in problems if problem.name != "seven"}
        runs.append({**runs[0], **again})
    draw(scores, growing, given.plot)
    sys.stdout.write(f"{given.plot}\n")
    last = runs[-1]
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
    yield Row("seven_axis_success", "1", [len(last["seven"].spent) / last["seven"].queries])
    for growth in growing:
        most = 12.0 if growth.what == "legs" else None
        yield Row(f"{growth.what}_10x", "1", [growth.spent[-1] / growth.spent[0]], at_most=most)


def continued_rows(count: int) -> Iterator[Row]:
    """Yield the figures of motions with via points, and of the rest of stopped motions."""
    continued = score_continued(random(count))
    yield Row("onward_colliding", "", [continued.colliding])
    yield Row("onward_excess", "1", [max(continued.over)])


def deadline_rows(robot: Robot, count: int, folder: Path) -> Iterator[Row]:
    """Yield the delay of deadlines, the time to cancel, and from there to the next plan."""
    late, canceled, again = deadlines(robot, count, folder)
    yield Row("past_deadline_ms", "ms", late, at_most=10.0, each=True)
    yield Row("cancel_ms", "ms", canceled)
    yield Row("next_after_kill_ms", "ms", again, at_most=300.0, each=True)


def mesh_rows(folder: Path, count: int) -> Iterator[Row]:
    """Yield the figures of arms with meshes."""
    arms = mesh_arms.arms(folder)
    so101 = list(mesh_arms.spent(load_robot(Path("so101")), 3 * count))
    yield Row("so101_p50_ms", "ms", [statistics.median(so101)], at_most=1.0)
    yield Row("mesh_poison_ms", "ms", [x for arm in arms for x in mesh_arms.poison(arm, count)])
    late = [x for arm in arms for x in mesh_arms.late(arm, count)]
    yield Row("mesh_past_deadline_ms", "ms", late, at_most=10.0, each=True)


def world_rows(robot: Robot, count: int, folder: Path) -> Iterator[Row]:
    """Yield the figures of large worlds that change a little."""
    moved = list(changed_worlds.one_box_moved(robot, count))
    yield Row("box_of_400_moved_ms", "ms", moved, at_most=100.0, each=True)
    beside = list(changed_worlds.box_beside_mesh(robot, count, folder))
    yield Row("box_beside_mesh_ms", "ms", beside, at_most=100.0, each=True)
    again = list(changed_worlds.next_after_kill_of_400(robot, count, folder))
    yield Row("next_after_kill_of_400_ms", "ms", again, at_most=300.0, each=True)
    again = list(changed_worlds.next_after_kill_beside_mesh(robot, count, folder))
    yield Row("next_after_kill_beside_mesh_ms", "ms", again, at_most=300.0, each=True)


def room_row(count: int, folder: Path) -> Row:
    """Return the time to plan in a room that is one mesh, divided by that in a room of boxes."""
    return Row("room_ratio", "1", list(room.ratios(count, folder)))


def held_out_rows(folder: Path, scenes: int, seed: int) -> Iterator[Row]:
    """Yield what an independent checker finds in plans of random scenes."""
    robots = held_out.arms(folder)
    found = [each for robot in robots for each in held_out.checked(robot, scenes, seed)]
    solved = [each for each in found if each.solved]
    kept = [each.kept for each in solved]
    bent = sum(not each.straight for each in solved)
    sys.stdout.write(f"{len(found)} queries, {len(solved)} plans, {bent} of them not straight\n")
    yield Row("held_out_solved", "1", [len(solved) / len(found)])
    yield Row("held_out_colliding", "", [sum(share < 0.0 for share in kept)], at_most=0)
    yield Row("held_out_kept_margin", "1", [min(kept)], at_least=held_out.PROMISED)
    yield Row("held_out_outside", "rad, m", [max(each.outside for each in solved)], at_most=0.0)
    yield Row("held_out_excess", "1", [max(each.excess for each in solved)], at_most=0.001)


def narrow_rows(folder: Path, count: int, peers: dict[str, Path]) -> Iterator[Row]:
    """Yield the figures of goals in a shelf: the arm that solves least, and a time of each arm."""
    problems = list(narrow.narrow(folder, count))
    scores = [_shown(ours(problem)) for problem in problems]
    shares = [len(score.spent) / score.queries for score in scores]
    yield Row("narrow_solved", "1", [min(shares)], at_least=1.0)
    yield Row("narrow_p50_ms", "ms", [score.p(50) for score in scores if score.spent])
    if "roboplan" in peers:
        others = list(_answered("roboplan", peers["roboplan"], problems, folder))
        pairs = [(score, peer) for score, peer in zip(scores, others, strict=True) if peer]
        ratios = [mine.p(50) / peer.p(50) for mine, peer in pairs if mine.spent and peer.spent]
        if ratios:
            yield Row("narrow_p50_ratio", "1", ratios, at_most=1.0)


def clutter_rows(given: argparse.Namespace, peers: dict[str, Path], folder: Path) -> Iterator[Row]:
    """Yield the figures of MotionBenchMaker's problems, and of collision checks in its scenes."""
    problems, count = clutter.checkout(given.environments, sys.stdout.write), given.clutter
    if not problems:
        return
    found = clutter.score(problems, count, folder)
    spent = list(found.spent.values())
    yield Row("clutter_solved", "1", [len(spent) / found.queries], at_least=0.99)
    yield Row("clutter_p50_ms", "ms", [float(np.percentile(spent, 50))], at_most=20.0)
    yield Row("clutter_p95_ms", "ms", [float(np.percentile(spent, 95))], at_most=200.0)
    for scene, times in found.scenes():
        yield Row(
            f"clutter_{scene.removesuffix('_panda')}_p50_ms", "ms", [statistics.median(times)]
        )
    yield Row("clutter_duration_s", "s", [statistics.fmean(found.durations.values())])
    yield Row("clutter_kept_margin", "1", [min(found.kept)], at_least=held_out.PROMISED)
    few = list(clutter.for_peers(problems, min(count, _FOR_PEERS), folder))
    best = dict[str, float]()
    for name in peers.keys() - {"ruckig"}:  # ruckig ignores obstacles
        for score in _answered(name, peers[name], few, folder):
            if score and score.spent and not score.colliding:
                duration = score.durations[0]
                best[score.problem] = min(duration, best.get(score.problem, duration))
    both = sorted(best.keys() & found.durations.keys())
    if both:
        ratios = [found.durations[k] / best[k] for k in both]
        yield Row("clutter_duration_ratio", "1", ratios, at_most=1.05)
    rates = list(clutter.rates(problems, folder))
    yield Row("configurations_per_s", "1/s", [ours for ours, _ in rates])
    yield Row("coal_alone_per_s", "1/s", [coal for _, coal in rates])


def _answered(
    name: str, venv: Path, problems: Sequence[Problem], folder: Path
) -> Iterator[Score | None]:
    """Yield another planner's score for each problem; None if its script fails."""
    for problem in problems:
        try:
            yield _shown(peer(name, venv, problem, folder))
        except RuntimeError as error:
            sys.stdout.write(f"{problem.name:<9} {name}: FAILED: {error}\n")
            yield None


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
        "700, which take some minutes)",
    )
    parser.add_argument(
        "--seed", type=int, default=1, metavar="N", help="of the random scenes (default: 1)"
    )
    parser.add_argument("--plot", type=Path, default=Path("planning.png"), metavar="PNG")
    parser.add_argument(
        "--environments",
        type=Path,
        default=Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "armtree-peers",
        metavar="DIR",
        help="folder of the other planners' environments, 1.5 GB (default: %(default)s)",
    )
    parser.add_argument("--only", default="", metavar="ROW", help="rows whose names begin so")
    given = parser.parse_args()
    wanted = {} if given.no_peers else PEERS
    found = {name: installed(name, given.environments, sys.stdout.write) for name in wanted}
    peers = {name: venv for name, venv in found.items() if venv}
    with tempfile.TemporaryDirectory() as name:
        chosen = [
            row
            for names, measure in groups(given, peers, Path(name))
            if any(
                row.startswith(given.only) or given.only.startswith(row) for row in names.split()
            )
            for row in measure()
            if row.name.startswith(given.only)
        ]
    show(chosen, given.json)


def groups(
    given: argparse.Namespace, peers: dict[str, Path], folder: Path
) -> Iterator[tuple[str, Callable[[], Iterable[Row]]]]:
    """Yield the names of rows that are measured together, and the function that measures them."""
    robot, quick = load_robot(), given.quick
    # First, while as little is in memory as in the process that runs a task.
    yield (
        "worker_overhead_ms",
        lambda: [Row("worker_overhead_ms", "ms", overheads(robot, 100 if quick else 500))],
    )
    yield _COMPARED, lambda: compared_rows(given, peers, folder)
    yield "onward_colliding onward_excess", lambda: continued_rows(10 if quick else 100)
    yield (
        "past_deadline_ms cancel_ms next_after_kill_ms",
        lambda: deadline_rows(robot, 10 if quick else 50, folder),
    )
    yield "poison_ms", lambda: [Row("poison_ms", "ms", list(poison(robot)))]
    yield (
        "so101_p50_ms mesh_poison_ms mesh_past_deadline_ms",
        lambda: mesh_rows(folder, 10 if quick else 100),
    )
    yield (
        "box_of_400_moved_ms box_beside_mesh_ms next_after_kill_of_400_ms "
        "next_after_kill_beside_mesh_ms",
        lambda: world_rows(robot, 5 if quick else 20, folder),
    )
    yield "room_ratio", lambda: [room_row(30 if quick else 300, folder)]
    yield (
        "held_out_solved held_out_colliding held_out_kept_margin held_out_outside held_out_excess",
        lambda: held_out_rows(folder, 4 if quick else 20, given.seed),
    )
    yield (
        "narrow_solved narrow_p50_ms narrow_p50_ratio",
        lambda: narrow_rows(folder, 5 if quick else 30, peers),
    )
    yield (
        "growth_10k_plans_mb",
        lambda: [Row("growth_10k_plans_mb", "MB", [growth_mb(robot, 1_000 if quick else 10_000)])],
    )
    yield _CLUTTER, lambda: clutter_rows(given, peers, folder)


if __name__ == "__main__":
    main()
