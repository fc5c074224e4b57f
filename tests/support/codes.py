"""Every code of armtree."""

from executive.api.codes import ROWS, Code
from executive.code_table import describe, load_errors
from hardware.errors import ArmtreeError

ROOMS = ("executive", "hardware", "logs", "skills", "trees")


def all_codes() -> dict[str, Code]:
    """Return what each code of armtree means, sorted by code."""
    load_errors()
    ours = {
        code: describe(kind)
        for code, kind in ArmtreeError.by_code.items()
        if kind.__module__.partition(".")[0] in ROOMS
    }
    return dict(sorted((ROWS | ours).items()))
