"""The robot model for planning: joints, shapes of links, and how far they move."""
