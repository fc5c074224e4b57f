"""Reading of YAML files to checked task files; every mistake has its line."""
