"""The robot as data: robot file, URDF and forward kinematics."""
