"""What the lay is, what is commanded because of it, and within which bounds: no ROS, no clock."""
