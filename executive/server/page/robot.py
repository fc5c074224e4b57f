"""The robot, as the page needs it."""

from typing import Any

from hardware import Robot


def description(robot: Robot) -> dict[str, Any]:
    """Return the robot as a JSON object."""
    return {"name": robot.name, "opening": robot.open_effect}
