"""Planner processes and the messages to and from them."""
