"""Recordings for clients of the server: their list, their events, and actions on them."""
