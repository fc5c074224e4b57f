"""Teleoperation: an arm follows a leader, an arm that a person moves by hand."""
