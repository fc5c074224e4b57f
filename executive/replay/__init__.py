"""Replay: verification of recordings, sending frames again, and the tree of a recorded run."""
