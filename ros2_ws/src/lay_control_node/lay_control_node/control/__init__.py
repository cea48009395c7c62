"""What is the lay now, and what is commanded for it, within which bounds? No ROS, no clock."""
