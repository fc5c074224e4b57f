"""From a task's files to its tree, with every check of it, and pictures of the tree."""
