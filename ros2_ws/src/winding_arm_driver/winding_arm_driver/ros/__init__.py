"""ROS sides that need interfaces of their own."""
