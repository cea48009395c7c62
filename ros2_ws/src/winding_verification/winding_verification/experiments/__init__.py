"""Other people's experiments, from files that stay where they are."""
