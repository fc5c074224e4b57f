"""Recordings of goals, with all data for verification."""
