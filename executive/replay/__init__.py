"""Verification of recordings, sending one again, and the tree of a recorded run."""
