"""The page: what it shows and what it can ask for, without ROS."""
