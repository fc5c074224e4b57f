"""The robot model, and inverse kinematics."""
