"""Entry point of `armtree`, `python -m armtree` and `python -m executive`."""

import gc
import sys

_ALLOCATIONS = 10_000  # objects between two collections; imports make many objects but no garbage


def main() -> None:
    """Run the command line. Ctrl-C while it is loading also exits without a traceback."""
    gc.set_threshold(_ALLOCATIONS)
    try:
        from .cli import main as cli

        cli.main()
    except KeyboardInterrupt:
        from .api.codes import INTERRUPTED_EXIT

        sys.exit(INTERRUPTED_EXIT)


if __name__ == "__main__":
    main()
