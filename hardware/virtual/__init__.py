"""Stand-ins for a board: one pure model, behind a pseudo-terminal or in-process."""
