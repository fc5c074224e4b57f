"""A motion as values: its path as a curve, its time law, and both as a plan."""
