"""What a recording is good for: verify it, show its tree, send its frames again."""
