"""What the mask has wrong in all frames, in the picture of a band."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import FlagArray, FloatArray, IndexArray

# One standard deviation [px] of a constant, of what goes with the sine of the azimuth, and with
# twice its square less one, along the cylinder as across it. Most likely at the true pose of 70 random
# scenes of the simulated camera were, of all bands in common, 0.01 to 0.10; of one marker beside
# that 0.01 or 0.02, once 0.08; of bands beside another turn, whose one free side is not made up for
# by the other, 0.04 to 0.13, and up to 0.5 with a wrong pose, where gates cut off another part than
# the model does.
COMMON, OF_MARKER, OF_CUT = 0.08, 0.03, 0.2
# Where light and focus are anything: with highlights of up to 0.4 of the light's colour, a blur of
# up to 1.5 px and mosaics, in 60 scenes, 0.06 to 0.32 at the true numbers.
IN_ANY_LIGHT = 0.2
# A turn whose axis is nearer than this may hide or cut off a part, in radii of the cable: where it
# lies is believed to some tenths of a radius.
BESIDE = 2.6
# How far a gate cuts into a band is known to so much beyond that, in each frame anew [px].
CUT_SCATTER = 0.25


def cut_off(bands: FloatArray, cable_radius: float) -> tuple[FlagArray, FlagArray]:
    """Return which bands lie beside a turn at -z, and at +z, that may cut them off, shape (k,).

    Args:
        bands: Fields of `Band`, shape (k, 7).
        cable_radius: [m]
    """
    low, high, below, above = bands.T[3:]
    near = BESIDE * cable_radius
    return (low > -math.pi) | (below < near), (high < math.pi) | (above < near)


def bias_shapes(
    azimuth: FloatArray,
    row: IndexArray,
    cuts: tuple[FlagArray, FlagArray],
    common: float = COMMON,
) -> tuple[FloatArray, FloatArray]:
    """Return what each unit of bias adds to the pictures, and what is believed of it.

    Args:
        azimuth: Of each sighting [rad], shape (k,).
        row: Place of each sighting's marker among those that were seen, shape (k,).
        cuts: See `cut_off`.
        common: What is believed of all bands in common [px].

    Returns:
        Shapes, (k, 2, biases), and one standard deviation of each [px], (biases,).
    """
    sine = np.sin(azimuth)
    curves = np.array([np.ones(sine.size), sine, 2.0 * sine**2 - 1.0])
    groups = [(np.ones(sine.size, dtype=bool), common)]
    groups += [(row == i, OF_MARKER) for i in np.unique(row)]
    groups += [(cut, OF_CUT) for cut in cuts if cut.any()]
    members = np.array([group for group, _ in groups], dtype=float)
    shapes = np.einsum("gk,sk,ab->kagsb", members, curves, np.eye(2))
    sigmas = np.repeat([sigma for _, sigma in groups], 2 * len(curves))
    return shapes.reshape(sine.size, 2, -1), sigmas
