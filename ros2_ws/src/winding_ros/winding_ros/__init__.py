"""ROS side of the shared language: topics, messages, parameters, managed nodes, processes."""
