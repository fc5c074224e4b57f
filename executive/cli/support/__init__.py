"""Shared parts of commands: options, signals, errors, and the work behind a command."""
