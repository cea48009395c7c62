"""How readings, records and frames are encoded as ROS messages, and decoded again."""
