"""What is told of a run: as records, with all it takes to prove the run from its file alone."""
