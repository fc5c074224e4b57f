"""Collision-free paths: straight lines, single bends, RRT-Connect, shortcuts and blends."""
