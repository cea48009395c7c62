"""What is judged of a run, and a configured number that speaks against it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.evidence import SightingLog

FloatArray = NDArray[np.float64]


class Signature(NamedTuple):
    """What the bands show of the geometry, or what a wrong number changes of it."""

    motion: float  # Logarithm of seen azimuth per azimuth
    area: float  # Logarithm of seen area per expected area


@dataclass(frozen=True, kw_only=True)
class Contradiction:
    """A configured number that the pictures speak against.

    Attributes:
        number: Its name: encoder_scale, frame_times, encoder_or_times, cylinder_diameter,
            cable_diameter, focal_length, band_width, geometry, marker_spacing, marker_colour or
            light.
    """

    number: str
    share: float  # By how much it is set too large, relative; nan where that is not known
    sigma: float  # Standard error of the share; nan where it is not known
    sentence: str  # In words


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What is judged.

    Attributes:
        gaps: Wound angle between known neighbours over the expected one, by the first's number.
    """

    log: SightingLog  # Sightings of the run
    area: FloatArray  # Measured over expected area of the known bands
    effects: Mapping[str, Signature]  # See `signatures`
    gaps: Mapping[int, float]
    known: tuple[int, ...]  # Numbers of the known markers after P0
    between: tuple[int, ...]  # Numbers of the markers after which a band lies that has no number


def size_in_words(share: float) -> str:
    """Return how much too large or small a number is, of its relative share."""
    return f"{abs(share):.1%} too {'large' if share > 0.0 else 'small'}"
