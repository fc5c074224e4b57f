"""`armtree`, and `python -m executive`."""

import sys


def main() -> None:
    """Begin; Ctrl-C while the command line is being loaded ends as quietly as later."""
    try:
        from .cli import main as cli

        cli.main()
    except KeyboardInterrupt:
        from .codes import INTERRUPTED_EXIT

        sys.exit(INTERRUPTED_EXIT)


if __name__ == "__main__":
    main()
