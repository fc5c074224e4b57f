"""What is recorded, and as which message on which topic."""
