"""The machine's motion for a lay program: guide, cylinder and pull over time, with what remains."""
