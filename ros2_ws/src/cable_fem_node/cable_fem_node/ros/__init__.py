"""ROS side of the solver without a node: what it answers to which message."""
