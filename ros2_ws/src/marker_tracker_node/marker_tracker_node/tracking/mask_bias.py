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
# bands beside another turn, whose one free side is not made up for by the other.
COMMON = ((0.1, 0.05), (0.06, 0.12), (0.06, 0.06))
OF_MARKER = ((0.05, 0.05), (0.05, 0.05), (0.05, 0.05))
OF_CUT = ((0.3, 0.1), (0.2, 0.1), (0.2, 0.1))
# A turn whose axis is nearer than this may hide or cut off a part, in radii of the cable: where it
# lies is believed to some tenths of a radius.
BESIDE = 2.6
# How far a gate cuts into a band is known to so much beyond that, in each frame anew [px].
CUT_SCATTER = 0.25


def cut_off(sightings: Sightings, cable_radius: float) -> tuple[BoolArray, BoolArray]:
    """Return which bands lie beside a turn at -z, and at +z, that may cut them off, shape (k,)."""
    s, near = sightings, BESIDE * cable_radius
    return (s.low > -math.pi) | (s.below < near), (s.high < math.pi) | (s.above < near)


def bias_shapes(
    sightings: Sightings, row: IndexArray, cuts: tuple[BoolArray, BoolArray]
) -> tuple[FloatArray, FloatArray]:
    """Return what each unit of bias adds to the pictures, and what is believed of it.

    Args:
        sightings: Of a run.
        row: Place of each sighting's marker among those that were seen, shape (k,).
        cuts: See `cut_off`.

    Returns:
        Shapes, (2 k, biases), and one standard deviation of each [px], (biases,).
    """
    sine = np.sin(sightings.azimuth)
    shapes = [np.ones(sine.size), sine, 2.0 * sine**2 - 1.0]
    groups = [(np.ones(sine.size), COMMON)]
    groups += [((row == i).astype(float), OF_MARKER) for i in np.unique(row)]
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
