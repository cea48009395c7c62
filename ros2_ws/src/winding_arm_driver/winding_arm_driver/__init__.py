"""Driver for a winding machine whose guide a robot arm carries."""
