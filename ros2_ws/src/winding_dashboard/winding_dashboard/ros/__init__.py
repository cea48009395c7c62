"""ROS side of the page: looking at topics, calling services."""
