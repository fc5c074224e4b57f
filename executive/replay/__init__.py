"""A recording verified: planned again, compiled again, and the first difference explained."""
