"""What does a run look like: one HTML page with its pictures."""
