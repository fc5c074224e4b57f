"""Models of an Arduino with its program."""
