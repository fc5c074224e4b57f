"""Worker processes that plan: a pool, its processes, their main program, and messages."""
