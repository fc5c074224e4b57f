"""Task files and skills to a py_trees tree."""
