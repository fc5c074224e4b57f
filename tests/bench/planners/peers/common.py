"""What every peer's script does, with nothing but the standard library: python PEER.py IN OUT."""

import array
import importlib.metadata
import json
import sys
import time
from pathlib import Path

TICK = 0.001  # the judge looks every millisecond [s]


def serve(package, make):
    """Answer all queries of the problem in the file IN, and write what came out to OUT.

    Args:
        package: Distribution whose version is told.
        make: From the problem, `solve(start, goal, seed)`, which is timed and gives a trajectory
            or None, and `sample(trajectory)`, which is not and gives its positions at every tick.
    """
    problem, out = json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2])
    solve, sample = make(problem)
    for start, goal in problem["pairs"][:3]:
        solve(start, goal, 1)  # what is loaded or built at first need is not timed
    rows = []
    with out.with_suffix(".bin").open("wb") as binary:
        for seed, (start, goal) in enumerate(problem["pairs"], 1):
            begun = time.perf_counter()
            try:
                found = solve(start, goal, seed)
            except Exception as error:  # whatever it is, it costs the peer this query alone
                sys.stderr.write(f"{package}: {error}\n")
                found = None
            spent = 1e3 * (time.perf_counter() - begun)
            positions = [] if found is None else sample(found)
            for position in positions:
                array.array("d", position).tofile(binary)
            rows.append({"ms": spent, "samples": len(positions)})
    version = importlib.metadata.version(package)
    out.write_text(json.dumps({"version": version, "rows": rows}))
