"""The licences of all pins of the locks, as `docs/dependencies.md` lists them.

`python -m tests.support.generated.licences` prints the table.
"""

import re
from collections import defaultdict
from importlib.metadata import Distribution, PackageNotFoundError

from tests.support.paths import ROOT

RUNS = ("lock", "lock-fleet", "lock-mcp")
# For packages without an SPDX expression in their metadata: what their licence files say.
_READ = {
    "cmeel-qhull": "Qhull",
    "colorama": "BSD-3-Clause",  # on Windows only
    "feetech-servo-sdk": "Unlicense",
    "grimp": "BSD-2-Clause",
    "import-linter": "BSD-2-Clause",
    "matplotlib": "Matplotlib",
    "pathspec": "MPL-2.0",
    "ros-rosidl-adapter": "Apache-2.0",
    "ros-rosidl-generator-type-description": "Apache-2.0",
    "ros-rosidl-parser": "Apache-2.0",
    "rustypot": "Apache-2.0",
}
_CLASSIFIERS = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "MIT License": "MIT",
}


def pins(lock: str) -> set[str]:
    """Return the names of the packages of a lock."""
    text = (ROOT / ".ci" / f"{lock}.txt").read_text()
    return set(re.findall(r"^([\w.-]+)(?:\[[^]]*\])?==", text, re.MULTILINE))


def licence(name: str) -> str:
    """Return the licence of an installed package as an SPDX expression; "" if not installed."""
    if name in _READ:
        return _READ[name]
    try:
        fields = Distribution.from_name(name).metadata
    except PackageNotFoundError:
        return ""
    if "License-Expression" in fields:
        return fields["License-Expression"]
    classes = [each.rpartition(" :: ")[2] for each in fields.get_all("Classifier") or []]
    found = [_CLASSIFIERS[each] for each in classes if each in _CLASSIFIERS]
    return found[0] if found else fields["License"]


def table() -> list[str]:
    """Return the lines of the table: one row per licence."""
    running = set[str]().union(*map(pins, RUNS))
    groups = defaultdict[str, tuple[list[str], list[str]]](lambda: ([], []))
    for name in sorted(running | pins("lock-dev")):
        if of := licence(name):
            groups[of][name not in running].append(name)
    head = ["| licence | armtree uses | only its tests use |", "|---|---|---|"]
    rows = [(of, *map(", ".join, groups[of])) for of in sorted(groups, key=str.lower)]
    return head + [f"| {of} | {runs or '-'} | {tests or '-'} |" for of, runs, tests in rows]


if __name__ == "__main__":
    print("\n".join(table()))  # noqa: T201, what it is for
