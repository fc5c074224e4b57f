"""An arm that follows a hand-guided arm: leader, screen and run."""
