"""The terminal: standard streams, questions to the operator, and how a run is shown."""
