"""Quality over runs: the index of a folder, control charts, pages."""
