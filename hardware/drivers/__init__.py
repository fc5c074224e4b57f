"""Drivers: one interface, and one folder per kind of board."""
