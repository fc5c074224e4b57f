"""Links to a board: serial ports, their list, and deadlines."""
