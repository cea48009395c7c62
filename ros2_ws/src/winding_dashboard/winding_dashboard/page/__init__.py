"""What the page says and what it can ask for, without ROS and without a web server."""
