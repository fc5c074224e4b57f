"""A robot as pinocchio reads it: its joints, the shapes of its links, and how far they can move."""

import pinocchio as pin

from hardware import Robot

from .errors import ModelUnusable
from .reach import Levers, level, levers
from .shapes import hull, packages
from .solid import solid_of


class Links:
    """What is the same of a robot in every world.

    Args:
        robot: The robot.

    Attributes:
        kinematics: pinocchio's model; followers share the coordinate of the joint they follow.
        exact: Every primitive or mesh of the URDF.
        outer: The convex hull around those of each link.
        solids: Of each of `exact` what it encloses; None of a primitive.
        levers: Of each of `outer`; see `reach`.
        level: Those of the floor.

    Raises:
        ModelUnusable: pinocchio cannot read the URDF.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, urdf = robot, str(robot.urdf)
        try:
            self.kinematics = pin.buildModelFromUrdf(urdf, True)
            self._loose = pin.buildModelFromUrdf(urdf)  # followers with coordinates of their own
            self.exact: list[pin.GeometryObject] = list(
                pin.buildGeomFromUrdf(
                    self.kinematics, urdf, pin.GeometryType.COLLISION, None, packages(robot.urdf)
                ).geometryObjects
            )
            self.outer = self._hulls()
        except (RuntimeError, ValueError) as error:
            raise ModelUnusable(urdf, str(error)) from error
        self.solids = [solid_of(shape.geometry) for shape in self.exact]
        self.level = level(self._loose)
        self.levers = [self.levers_of(shape) for shape in self.outer]

    def levers_of(self, shape: pin.GeometryObject) -> Levers:
        """Of a shape on one of the joints."""
        joint = self._loose.getJointId(self.kinematics.names[shape.parentJoint])
        return levers(self._robot, self._loose, joint, shape)

    def _hulls(self) -> list[pin.GeometryObject]:
        links = dict[int, list[pin.GeometryObject]]()
        for shape in self.exact:
            links.setdefault(shape.parentFrame, []).append(shape)
        return [
            pin.GeometryObject(
                self.kinematics.frames[frame].name,
                shapes[0].parentJoint,
                frame,
                pin.SE3.Identity(),
                hull(shapes),
            )
            for frame, shapes in links.items()
        ]
