"""How an identification refuses: one sentence with the value and the limit."""

from __future__ import annotations


class IdentificationError(ValueError):
    """The material cannot be identified from what was given."""
