"""ROS side of the learned correction factor without a node: what it answers to which message."""
