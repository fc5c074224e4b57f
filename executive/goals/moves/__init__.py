"""Moves: their words, the task that they become, and poses."""
