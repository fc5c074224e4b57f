"""Exports trees as pictures, tables and Groot2 files, and the JSON Schema of task files."""
