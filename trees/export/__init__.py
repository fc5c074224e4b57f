"""Trees as pictures, Groot2 files and JSON Schema."""
