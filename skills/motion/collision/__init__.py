"""Collision checking: configurations, motions and bodies."""
