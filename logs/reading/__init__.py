"""Reading recordings, validating them and recovering damaged ones."""
