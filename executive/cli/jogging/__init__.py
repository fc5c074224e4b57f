"""Jogging: keys move an arm of this command or of a server in small steps, shown on a screen."""
