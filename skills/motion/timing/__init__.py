"""Timing: trapezoidal profiles on lines, TOPP-RA on curves, and the rest of stopped motions."""
