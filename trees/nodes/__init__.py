"""The control nodes: sequences, fallbacks, parallels, loops and decorators."""
