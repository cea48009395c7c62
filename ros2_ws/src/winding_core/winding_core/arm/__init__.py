"""An arm that carries the guide: where it stands, how it moves, and what it can do."""
