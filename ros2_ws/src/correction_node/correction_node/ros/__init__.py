"""ROS side of the learned weight without a node: what it answers to which message."""
