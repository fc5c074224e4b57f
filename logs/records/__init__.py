"""Records, and the message and topic of each record."""
