"""Previews of a motion: dry runs, plans, their explanation and drawing."""
