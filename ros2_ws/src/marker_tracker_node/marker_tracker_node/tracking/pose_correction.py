"""How far a camera's pose is believed, and how much of a fitted correction the data carry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# A correction of so many of its own standard deviations is no chance: with a right pose 26 random
# scenes reached 2.7 at most.
CARRIED = 5.0


@dataclass(frozen=True, kw_only=True)
class PoseBelief:
    """How well the nominal pose was known before the run, one standard deviation.

    What is taken by default is a camera on a bracket, set by tape measure and spirit level.

    Attributes:
        position: Of each coordinate [m]; zero where it is known.
        tilt: About each axis [rad]; zero where it is known.
    """

    position: float = 2.0e-3
    tilt: float = 10.0e-3

    def __post_init__(self) -> None:
        for name in ("position", "tilt"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")

    @property
    def sigmas(self) -> FloatArray:
        """Of tilt [rad] and position [m], shape (6,)."""
        return np.array([self.tilt] * 3 + [self.position] * 3)


def carried_correction(
    data: FloatArray, best: FloatArray, nominal: FloatArray, belief: PoseBelief
) -> tuple[FloatArray, FloatArray]:
    """Return the part of a fitted change of pose that the data carry, and its covariance.

    In units of the belief the data's information has six axes of its own. Along one of them the
    change is taken whole if it is `CARRIED` standard deviations of the data or more, and else left
    out: a right pose is then left alone. What was left out counts as error.

    Args:
        data: Information on the pose without any belief, shape (6, 6).
        best: Fitted change from the present pose, tilt [rad] and position [m], shape (6,).
        nominal: Change that would lead to the nominal pose, shape (6,).
        belief: How well that was known.
    """
    sigmas = belief.sigmas
    free = sigmas > 0.0
    moved, covariance = np.zeros(6), np.zeros((6, 6))
    moved[~free] = nominal[~free]
    if not free.any():
        return moved, covariance
    unit = sigmas[free]
    information = data[np.ix_(free, free)] * np.outer(unit, unit)
    strength, axes = np.linalg.eigh(0.5 * (information + information.T))
    strength = np.maximum(strength, 0.0)
    change = axes.T @ (best[free] / unit)
    # The data alone would go further than the compromise with the belief does.
    centre = axes.T @ (nominal[free] / unit)
    alone = change + (change - centre) / np.maximum(strength, 1.0e-12)
    carried = np.abs(alone) * np.sqrt(strength) >= CARRIED
    taken = np.where(carried, change, 0.0)
    variance = 1.0 / (1.0 + strength) + (change - taken) ** 2
    moved[free] = unit * (axes @ taken)
    covariance[np.ix_(free, free)] = np.outer(unit, unit) * ((axes * variance) @ axes.T)
    return moved, covariance
