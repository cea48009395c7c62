"""What the page shows and what it can request, without ROS and without a web server."""
