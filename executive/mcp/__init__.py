"""Tools for language models: a process of its own, which speaks the Model Context Protocol."""
