"""YAML files to checked task files; every mistake with its line."""
