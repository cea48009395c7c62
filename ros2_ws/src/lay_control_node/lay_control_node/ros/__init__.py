"""ROS side of the lay controller without a node: what it answers to which message."""
