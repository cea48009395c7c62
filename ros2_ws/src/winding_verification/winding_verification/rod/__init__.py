"""A rod of any shape and load, for problems with closed forms; it winds nothing."""
