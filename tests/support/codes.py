"""Every code of armtree."""

from executive.code_table import load_errors
from hardware import ArmtreeError

ROOMS = ("executive", "hardware", "logs", "skills", "trees")


def all_codes() -> dict[str, type[ArmtreeError]]:
    """Return the class of each code of armtree, sorted by code."""
    load_errors()
    found = sorted(ArmtreeError.by_code.items())
    return {code: kind for code, kind in found if kind.__module__.partition(".")[0] in ROOMS}
