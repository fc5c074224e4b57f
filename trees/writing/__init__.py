"""Writes task files and the poses file of the user."""
