"""The virtual Arduino: one pure model, behind a pseudo-terminal or in-process."""
