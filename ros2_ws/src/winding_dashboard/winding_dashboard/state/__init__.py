"""What the page keeps of what it hears, and how it looks at a moment; no ROS, no web server."""
