"""Recordings of goals: what is recorded, with everything that verification needs."""
