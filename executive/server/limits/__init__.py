"""Fair use: queueing and rate limits."""
