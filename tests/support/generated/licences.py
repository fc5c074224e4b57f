"""The licences of all pins of the locks, as `docs/dependencies.md` lists them.

`python -m tests.support.generated.licences` prints the table.
"""

import re
import sys
import sysconfig
from collections import defaultdict
from collections.abc import Iterator
from importlib.metadata import Distribution

from tests.support.paths import ROOT

RUNS = ("lock", "lock-fleet", "lock-mcp", "lock-ros2")
ROS2 = ROOT / ".venv" / "ros2"
_ROS2_PACKAGES = sysconfig.get_path("purelib", vars={"base": str(ROS2)})
# For packages without an SPDX expression in their metadata: what their licence files say.
_READ = {
    "cmeel-qhull": "Qhull",
    "colorama": "BSD-3-Clause",  # on Windows only
    "feetech-servo-sdk": "Unlicense",
    "grimp": "BSD-2-Clause",
    "import-linter": "BSD-2-Clause",
    "matplotlib": "Matplotlib",
    "pathspec": "MPL-2.0",
    "ros-fastcdr": "Apache-2.0",
    "ros-fastdds": "Apache-2.0",
    "ros-rosidl-adapter": "Apache-2.0",
    "ros-rosidl-generator-type-description": "Apache-2.0",
    "ros-rosidl-parser": "Apache-2.0",
    "rustypot": "Apache-2.0",
}
_CLASSIFIERS = {
    "Apache 2.0": "Apache-2.0",
    "Apache License 2.0": "Apache-2.0",
    "Apache License, Version 2.0": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "MIT License": "MIT",
    "zlib License": "Zlib",
}


def pins(lock: str) -> set[str]:
    """Return the names of the packages of a lock."""
    text = (ROOT / ".ci" / f"{lock}.txt").read_text()
    return set(re.findall(r"^([\w.-]+)(?:\[[^]]*\])?==", text, re.MULTILINE))


def licence(name: str) -> str:
    """Return the licence of an installed package as an SPDX expression; "" if not installed."""
    if name in _READ:
        return _READ[name]
    fields = next((each.metadata for each in _installed(name)), None)
    if fields is None:
        return ""
    if "License-Expression" in fields:
        return fields["License-Expression"]
    classes = [each.rpartition(" :: ")[2] for each in fields.get_all("Classifier") or []]
    found = [_CLASSIFIERS[each] for each in classes if each in _CLASSIFIERS]
    words = [found[0]] if found else [fields["License"]] if "License" in fields else _of_ros(name)
    return " AND ".join(sorted({_CLASSIFIERS.get(each, each) for each in words}))


def _of_ros(name: str) -> list[str]:
    """Return the licences of a wheel of ROS 2, whose package.xml names them."""
    package = name.removeprefix("ros-").replace("-", "_")
    manifest = ROS2 / "share" / package / "package.xml"
    return re.findall(r"<license[^>]*>([^<]+)</license>", manifest.read_text())


def _installed(name: str) -> Iterator[Distribution]:
    """Yield a package in this environment, and in the folder of ROS 2 beside it."""
    for path in (sys.path, [_ROS2_PACKAGES]):
        yield from Distribution.discover(name=name, path=path)


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
