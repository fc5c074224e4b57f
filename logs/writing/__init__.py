"""Writing recordings: recorder, journal, compaction and retention."""
