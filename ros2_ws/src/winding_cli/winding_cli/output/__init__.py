"""What a run shows on the terminal and leaves as numbers."""
