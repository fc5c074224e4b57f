"""The terminal: standard streams, questions to the operator, and views of a run."""
