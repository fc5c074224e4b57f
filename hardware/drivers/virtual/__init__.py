"""Virtual boards: any model of a board, behind a pseudo-terminal or in this process."""
