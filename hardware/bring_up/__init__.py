"""Bringing up an arm with bus servos: what is on the bus, and how far each joint turns."""
