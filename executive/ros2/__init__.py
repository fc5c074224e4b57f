"""A node of ROS 2, which is a client of `armtree serve`."""
