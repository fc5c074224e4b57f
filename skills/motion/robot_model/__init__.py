"""The robot model for planning: joints, shapes of links, and bounds on their travel.

The forward kinematics for all rooms is in `hardware/description/forward_kinematics.py`.
"""
