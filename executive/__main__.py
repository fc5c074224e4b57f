"""`python -m executive` is `armtree`."""

from .cli import main

main()
