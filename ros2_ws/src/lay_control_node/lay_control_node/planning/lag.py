"""Where a sticking cable lands behind its guide: dz/dtheta = (g - z) / lag, integrated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Below this share of the lag the integrals take their series.
_SHORT = 1.0e-4


def lay_of(theta: Array, guide: Array, lag: float, start: float = 0.0) -> Array:
    """Return z of the laid cable [m], shape (n,), exact for a guide that goes straight in between.

    Args:
        theta: Wound angles, not descending [rad], shape (n,).
        guide: Of the guide there [m], shape (n,).
        lag: Free length over centreline radius [rad].
        start: z at the first angle [m].
    """
    x = np.diff(theta) / lag
    decay = np.exp(-x)
    gone = -np.expm1(-x)
    safe = np.where(x > _SHORT, x, 1.0)
    ramp = np.where(x > _SHORT, 1.0 - gone / safe, x / 2.0 - x**2 / 6.0)
    driven = guide[:-1] * gone + np.diff(guide) * ramp
    z, laid = start, [start]
    for kept, added in zip(decay.tolist(), driven.tolist(), strict=True):
        z = kept * z + added
        laid.append(z)
    return np.array(laid)
