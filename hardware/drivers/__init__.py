"""One folder per kind of board, behind one interface."""
