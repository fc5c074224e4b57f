"""Jogging: keys become small moves, shown on a screen, of this command's arm or a server's."""
