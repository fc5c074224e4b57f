"""What several commands share: options, signals, errors, and the work behind a command."""
