"""Stretch of the simulated cable under a load."""

from __future__ import annotations

import math


def neo_hookean_stretch(load: float, guess: float = 1.0) -> float:
    """Return the stretch of an incompressible neo-Hookean bar under a nominal stress over E.

    sigma / E = (lambda - lambda^-2) / 3.

    Args:
        load: sigma / E, above -0.2, dimensionless.
        guess: Stretch where the search begins, dimensionless.
    """
    stretch, step = guess, math.inf
    # Newton's method squares its error: after a step of this size there is none left.
    while abs(step) > 1.0e-9:
        step = (3.0 * load - stretch + stretch**-2) / (1.0 + 2.0 * stretch**-3)
        stretch += step
    return stretch
