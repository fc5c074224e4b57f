"""Checks before a run: reachability, data flow and predicted motion."""
