"""ROS side of the tracker without a node: what it answers to which message."""
