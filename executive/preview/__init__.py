"""What would move, before the arm moves: dry runs, plans, their explanation and drawing."""
