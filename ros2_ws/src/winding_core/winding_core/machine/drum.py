"""The drum: the cylinder between its flanges, with or without grooves."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.units import MILLIMETRE

Array = NDArray[np.float64]

_ROUNDING = 1.0e-6  # Places that lie against a flange may miss it by a rounding [m]

# Flange at which winding begins -> sign of z from there on.
START_SIDES = {"low": 1.0, "high": -1.0}


class DrumError(ValueError):
    """A drum is none, or cannot take what is wanted of it; the sentence names value and limit."""


@dataclass(frozen=True, kw_only=True)
class Drum:
    """A cylinder between two flanges; P0 lies against the flange at which winding begins."""

    radius: float  # R of the cylinder, or of the ground of its grooves [m].
    width: float  # Between the flanges [m].
    flange_height: float  # Of the flanges over R [m].
    groove_pitch: float | None = None  # Of the grooves [m]; None for a smooth drum.
    start_side: str = "low"  # One of START_SIDES: the flange at the lower or at the higher z.

    def __post_init__(self) -> None:
        for name in ("radius", "width", "flange_height", "groove_pitch"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                words = name.replace("_", " ")
                raise DrumError(
                    f"the drum's {words} must be positive and finite, got {value / MILLIMETRE:g} mm"
                )
        if self.start_side not in START_SIDES:
            raise DrumError(
                f"the drum's start side must be {' or '.join(START_SIDES)}, got {self.start_side!r}"
            )

    @property
    def flange_radius(self) -> float:
        """Radius of the flanges' edges [m]."""
        return self.radius + self.flange_height

    def centre_lines(self, cable_diameter: float) -> tuple[float, float]:
        """Return least and largest z of the centre line of a cable of a diameter [m] on it [m]."""
        far = self.sign * (self.width - cable_diameter)
        return min(far, 0.0), max(far, 0.0)

    def inner_faces(self, cable_diameter: float) -> tuple[float, float]:
        """Return lower and higher z of the flanges' inner faces [m], from P0's, of cable [m]."""
        first = -0.5 * self.sign * cable_diameter
        far = first + self.sign * self.width
        return min(first, far), max(first, far)

    def refuse_beyond(self, theta: Array, z: Array, cable_diameter: float) -> None:
        """Refuse cable that would lie beside the drum.

        Args:
            theta: Wound angles [rad], shape (n,).
            z: Where the centre line is laid there [m], shape (n,).
            cable_diameter: [m]

        Raises:
            DrumError: A place is beyond a flange.
        """
        low, high = self.centre_lines(cable_diameter)
        beyond = np.flatnonzero((z < low - _ROUNDING) | (z > high + _ROUNDING))
        if beyond.size:
            after = int(beyond[0])
            before = max(after - 1, 0)
            limit = min(max(float(z[after]), low), high)
            share = (limit - z[before]) / (z[after] - z[before] or 1.0)
            passed = theta[before] + share * (theta[after] - theta[before])
            farthest = z[np.argmax(np.maximum(low - z, z - high))]
            raise DrumError(
                f"the cable would leave the drum after {passed / math.tau:.4g} turns and come to "
                f"z = {farthest / MILLIMETRE:.4g} mm: between flanges "
                f"{self.width / MILLIMETRE:.4g} mm apart it lies from {low / MILLIMETRE:.4g} to "
                f"{high / MILLIMETRE:.4g} mm"
            )

    @property
    def sign(self) -> float:
        """Direction of z from the flange at which winding begins: 1 or -1."""
        return START_SIDES[self.start_side]
