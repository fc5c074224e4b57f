"""`python -m executive` is `armtree`."""

from .commands.cli import main

main()
