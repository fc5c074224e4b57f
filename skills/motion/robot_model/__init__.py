"""The robot model for planning: joints, shapes of links, and how far they move.

Forward kinematics that every room uses is in `hardware/description/forward_kinematics.py`.
"""
