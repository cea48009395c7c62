"""What the tracker finds when a number of its configuration is wrong, on runs whose truth is known."""
