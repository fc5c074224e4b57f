"""Commands typed in this very process, which saves the start of another."""

import logging
import os
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from unittest.mock import patch

from executive.cli.main import main


def typed(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command; it records into a folder."""
    out, err, root, status = StringIO(), StringIO(), logging.getLogger(), 0
    with (
        redirect_stdout(out),
        redirect_stderr(err),
        patch.object(sys, "argv", ["armtree", *arguments]),
        patch.object(root, "handlers", [*root.handlers]),  # the command adds its own
        patch.dict(os.environ, ARMTREE_RECORDINGS=str(folder)),
    ):
        try:
            main()
        except SystemExit as left:
            status = int(str(left.code))
    return status, out.getvalue(), err.getvalue()
