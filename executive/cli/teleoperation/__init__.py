"""An arm that follows another one, which a person moves: leader, screen and run."""
