"""The task executive: goals in, outcomes out. Its public face is the command line."""

__all__: list[str] = []
