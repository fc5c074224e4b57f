"""Versions of all code that affects plans and frames."""

import hashlib
import platform
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

import hardware
import skills.motion
from hardware.installed import version

_PLANNING = ("numpy", "pin", "coal")
_SCHEDULING = (
    "arm/schedule.py",
    "drivers/firmware_profile.py",
    "drivers/pacing.py",
    "drivers/null_driver.py",
    "drivers/arduino/firmware_profile.py",
    "drivers/arduino/frames.py",
    "drivers/arduino/serial_servo.py",
)


@cache
def versions() -> dict[str, str]:
    """Return versions by name. For armtree's own code, returns digests of the relevant files.

    Two installations with equal entries give equal plans and frames for equal queries.
    """
    own = {
        "armtree": version("armtree") or "none",
        "planner": _digest(skills.motion, "**/*.py"),
        "frames": _digest(hardware, *_SCHEDULING),
    }
    libraries = {name: version(name) or "none" for name in _PLANNING}
    machine = {"python": platform.python_version(), "machine": platform.machine()}
    return {**own, **libraries, **machine, "system": sys.platform}


def _digest(room: ModuleType, *patterns: str) -> str:
    folder, digest = Path(str(room.__file__)).parent, hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in folder.glob(pattern)):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:12]
