"""Forces of an extensible, bending, relaxing rod, from positions alone."""
