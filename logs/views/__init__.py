"""Plots, tables, narratives and comparisons of recordings."""
