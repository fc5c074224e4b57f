"""Reading recordings: complete, unfinished or damaged."""
