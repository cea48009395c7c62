"""The general rod: an open chain of extensible, bending, twisting elements."""
