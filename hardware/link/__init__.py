"""Links to a board: serial ports, their list and their lock."""
