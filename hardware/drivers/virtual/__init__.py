"""Virtual boards: models of boards, behind a pseudo-terminal or in this process."""
