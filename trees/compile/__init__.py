"""Compilation of task files and skills to a py_trees tree."""
