"""Collision-free paths: straight, bent or searched."""
