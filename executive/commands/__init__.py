"""The command line: one file per group of commands, and what a person sees of a run."""
