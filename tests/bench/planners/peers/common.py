"""Main program of each planner's script, with the standard library only: PEER.py IN OUT."""

import array
import contextlib
import importlib.metadata
import json
import sys
import time
from pathlib import Path

TICK = 0.001  # between checks of the reference checker [s]


def serve(package, make):
    """Answer all queries of the problem in the file IN, and write the results to OUT.

    Args:
        package: Distribution with the version to report.
        make: Takes the problem. Returns `solve(start, goal, seed)`, which is timed and returns a
            trajectory or None, and `sample(trajectory)`, which is not timed and returns the
            positions at every tick.
    """
    problem, out = json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2])
    solve, sample = make(problem)
    for start, goal in problem["pairs"][:3]:
        with contextlib.suppress(Exception):  # counted below
            solve(start, goal, 1)  # warm up: not timed
    rows = []
    with out.with_suffix(".bin").open("wb") as binary:
        for seed, (start, goal) in enumerate(problem["pairs"], 1):
            begun = time.perf_counter()
            try:
                found = solve(start, goal, seed)
            except Exception as error:  # only this query counts as not solved
                sys.stderr.write(f"{package}: {error}\n")
                found = None
            spent = 1e3 * (time.perf_counter() - begun)
            positions = [] if found is None else sample(found)
            for position in positions:
                array.array("d", position).tofile(binary)
            rows.append({"ms": spent, "samples": len(positions)})
    version = importlib.metadata.version(package)
    out.write_text(json.dumps({"version": version, "rows": rows}))
