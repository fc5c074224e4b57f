"""The shipped skills, one file each."""
