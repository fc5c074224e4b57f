"""Makes armtree quick to load: public names at their first use, and quick dataclasses."""
