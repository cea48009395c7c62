"""A configured number that the pictures speak against."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Contradiction:
    """A configured number that the pictures speak against.

    Attributes:
        number: Its name: one of `estimator.numbers`, marker_spacing, marker_colour or light.
        alternatives: Names of the numbers that explain the pictures as well.
    """

    number: str
    share: float  # By how much it is set too large, relative; nan where that is not known
    sigma: float  # Standard error of the share; nan where it is not known
    sentence: str  # In words
    alternatives: tuple[str, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """The number and its alternatives."""
        return frozenset({self.number, *self.alternatives})
