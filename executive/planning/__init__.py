"""`armtree plan`: goals from text, world files and drawings."""
