"""Entry point of `armtree`, `python -m armtree` and `python -m executive`."""

import gc
import os
import signal
import sys
import threading
from contextlib import suppress

_ALLOCATIONS = 10_000  # new objects until garbage is collected; imports make many, but no garbage
_SOON = 0.01  # time until a lost Ctrl-C is repeated [s]


def main() -> None:
    """Run the command line. Ctrl-C while it is loading also exits without a traceback."""
    gc.set_threshold(_ALLOCATIONS)
    sys.unraisablehook = _repeat_ctrl_c
    try:
        from .cli import main as cli

        cli.main()
    except KeyboardInterrupt:
        from .api.codes import INTERRUPTED_EXIT

        sys.exit(INTERRUPTED_EXIT)


def _repeat_ctrl_c(error: "sys.UnraisableHookArgs") -> None:
    """Repeat a Ctrl-C that Python ignored because it came in a finalizer or in a callback."""
    if not issubclass(error.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(error)
        return
    repeat = threading.Timer(_SOON, os.kill, (os.getpid(), signal.SIGINT))
    repeat.daemon = True
    with suppress(RuntimeError):  # the process is ending
        repeat.start()


if __name__ == "__main__":
    main()
