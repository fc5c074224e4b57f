"""Types of a motion: the curve of its path, its time law, and the plan that has both."""
