"""The robot model for planning: joints, shapes of links, and bounds on their travel.

All packages use the forward kinematics in `hardware/description/forward_kinematics.py`.
"""
