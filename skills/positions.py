"""Joint positions by name, as they stand in task files and travel between skills."""


class Positions(dict[str, float]):
    """Joint name to position [rad]."""
