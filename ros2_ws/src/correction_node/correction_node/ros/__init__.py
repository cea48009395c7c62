"""What does the correction answer to which message? Without a node."""
