"""Reads YAML files into checked task files. Every mistake has its line."""
