"""Bringing up an arm with bus servos: checks of the bus, and calibration."""
