"""What goes wrong with recordings."""

from __future__ import annotations


class BagError(ValueError):
    """A recording cannot be read, or not be written where it was asked to."""
