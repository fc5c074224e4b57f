"""Before the arm moves: goals from text, the known motions of a task, dry runs, world files."""
