"""Correction of a running machine, and what its own measured markers add."""
