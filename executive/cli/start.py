"""The start of the command line, before slow imports."""

import gc
import os
import signal
import sys
import threading
from contextlib import suppress

# New objects until garbage is collected. Imports make tens of thousands of objects, but no garbage.
_ALLOCATIONS = 100_000
_SOON = 0.01  # time until a lost Ctrl-C is repeated [s]


def start() -> None:
    """Run the command line."""
    gc.set_threshold(_ALLOCATIONS)
    sys.unraisablehook = _repeat_ctrl_c
    from .main import main

    main()


def _repeat_ctrl_c(error: "sys.UnraisableHookArgs") -> None:
    """Repeat a Ctrl-C that Python ignored because it came in a finalizer or in a callback."""
    if not issubclass(error.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(error)
        return
    repeat = threading.Timer(_SOON, os.kill, (os.getpid(), signal.SIGINT))
    repeat.daemon = True
    with suppress(RuntimeError):  # the process is ending
        repeat.start()
