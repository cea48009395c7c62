"""Whether a commissioning run finds what is hidden in a cell."""
