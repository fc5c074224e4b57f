"""Timing of motions: trapezoidal profiles on lines, TOPP-RA on curves, and stopped motions."""
