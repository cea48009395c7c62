"""What the mask of a band has wrong in all frames alike: more sightings do not average it out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.sightings import Sightings

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

# One standard deviation [px] along the cylinder and across it, of a constant, of what goes with the
# sine of the azimuth, and with twice its square less one. Of all bands in common: so much was left
# at the true pose in 23 random scenes of the simulated camera. Of one marker beside that. And of
# bands that a gate cuts off, whose one free side is not made up for by the other.
COMMON = ((0.1, 0.05), (0.06, 0.12), (0.06, 0.06))
OF_MARKER = ((0.05, 0.05), (0.05, 0.05), (0.05, 0.05))
OF_CUT = ((0.3, 0.1), (0.2, 0.1), (0.2, 0.1))
# How far a gate cuts into a band is known to so much beyond that, in each frame anew [px].
CUT_SCATTER = 0.25


def cut_off(sightings: Sightings) -> BoolArray:
    """Return which bands a neighbouring turn cuts off, shape (k,)."""
    return np.asarray((sightings.low > -math.pi) | (sightings.high < math.pi))


def bias_shapes(sightings: Sightings, row: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return what each unit of bias adds to the pictures, and what is believed of it.

    Args:
        sightings: Of a run.
        row: Place of each sighting's marker among those that were seen, shape (k,).

    Returns:
        Shapes, (2 k, biases), and one standard deviation of each [px], (biases,).
    """
    s = sightings
    sine = np.sin(s.azimuth)
    shapes = [np.ones(sine.size), sine, 2.0 * sine**2 - 1.0]
    groups = [(np.ones(sine.size), COMMON)]
    groups += [((row == i).astype(float), OF_MARKER) for i in np.unique(row)]
    cuts = (s.low > -math.pi, s.high < math.pi)
    groups += [(cut.astype(float), OF_CUT) for cut in cuts if cut.any()]
    columns, sigmas = [], []
    for group, believed in groups:
        for shape, both in zip(shapes, believed, strict=True):
            for axis, sigma in enumerate(both):
                column = np.zeros((sine.size, 2))
                column[:, axis] = group * shape
                columns.append(column.ravel())
                sigmas.append(sigma)
    return np.column_stack(columns), np.array(sigmas)
