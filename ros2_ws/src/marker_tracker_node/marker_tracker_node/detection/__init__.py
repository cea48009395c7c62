"""What a marker looks like in one picture: colour, gates, bands."""
