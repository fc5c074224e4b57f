"""The virtual Arduino: a model of the board, behind a pseudo-terminal or in this process."""
