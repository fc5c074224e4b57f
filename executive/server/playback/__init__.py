"""Recordings for clients of the server: their list, their events, and what is done with them."""
