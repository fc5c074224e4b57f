"""Versions of all code that affects plans and frames."""

import hashlib
import platform
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import hardware
from hardware.installed import version

_LIBRARIES = ("numpy", "pin", "coal")
_PLANNER = ("skills/motion/**/*.py",)

# Code between plans and frames: a driver is a folder; the models of boards only play frames.
FRAMES = ("skills/merged_motion.py", "hardware/arm/schedule.py", "hardware/drivers/**/*.py")
_MODELS = "virtual"


@cache
def versions() -> dict[str, str]:
    """Return versions by name. For armtree's own code, returns digests of the relevant files.

    Two installations with equal entries give equal plans and frames for equal queries.
    """
    root = Path(hardware.__file__).parents[1]
    own = {
        "armtree": version("armtree") or "none",
        "planner": digest(root, _PLANNER),
        "frames": digest(root, FRAMES),
    }
    libraries = {name: version(name) or "none" for name in _LIBRARIES}
    machine = {"python": platform.python_version(), "machine": platform.machine()}
    return {**own, **libraries, **machine, "system": sys.platform}


def digest(root: Path, patterns: Iterable[str]) -> str:
    """Return the digest of the files that match, except those of models of boards.

    Args:
        root: Folder that contains the packages of armtree.
        patterns: Patterns for paths in this folder.
    """
    found = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in root.glob(pattern)):
        if _MODELS not in path.relative_to(root).parts:
            found.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()[:12]
