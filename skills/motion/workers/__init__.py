"""Worker processes for planning: the pool, its processes, their main program, and messages."""
