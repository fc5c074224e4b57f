"""Time-optimal timing of a path within velocity and acceleration limits."""
