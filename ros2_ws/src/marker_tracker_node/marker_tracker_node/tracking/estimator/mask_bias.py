"""What the mask has wrong in all frames, in the picture of a band."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import FlagArray, FloatArray, IndexArray

Sigmas = tuple[float, float] | tuple[tuple[float, float], ...]

# One standard deviation [px] along the cylinder and across it, of a constant, of what goes with the
# sine of the azimuth, and with twice its square less one. Most likely at the true pose of 70 random
# scenes of the simulated camera were, of all bands in common, 0.09 and 0.01, 0.01 and 0.10, 0.04
# and 0.02; of one marker beside that 0.08 along the cylinder with the sine, all else 0.01 or 0.02.
# And of bands beside another turn, whose one free side is not made up for by the other: 0.04 to
# 0.13.
COMMON = ((0.1, 0.05), (0.06, 0.12), (0.06, 0.06))
# Where light and focus are anything: with highlights of up to 0.4 of the light's colour, a blur of
# up to 1.5 px and mosaics, in 60 scenes, 0.06 and 0.06, 0.06 and 0.32, 0.12 and 0.19 at the true
# numbers. Of the last ones across 0.25 and -0.13 is the mean, which is the band model's own.
IN_ANY_LIGHT = ((0.1, 0.1), (0.06, 0.2), (0.2, 0.15))
OF_MARKER = ((0.02, 0.02), (0.08, 0.03), (0.02, 0.03))
OF_CUT = (0.1, 0.05)
# A turn whose axis is nearer than this may hide or cut off a part, in radii of the cable: where it
# lies is estimated to some tenths of a radius.
BESIDE = 2.6
# How high a layer lies is known to so many cable diameters: in eight windings of three layers cable
# that had landed lay 0.04 to 0.13 beside where the guide's readings put it.
LIFT_SIGMA = 0.1
# How far a gate cuts into a band is known to so much beyond that, in each frame anew [px].
CUT_SCATTER = 0.2


def cut_off(bands: FloatArray, cable_radius: float) -> tuple[FlagArray, FlagArray]:
    """Return which bands a turn at -z, and one at +z, may cut off, shape (k,).

    Bands have the fields of `Band`, shape (k, 8); the cable's radius is in [m].
    """
    low, high, below, above = bands.T[3:7]
    near = BESIDE * cable_radius
    return (low > -math.pi) | (below < near), (high < math.pi) | (above < near)


def bias_shapes(
    azimuth: FloatArray,
    row: IndexArray,
    cuts: tuple[FlagArray, FlagArray],
    lifted: FloatArray,
    common: Sigmas = COMMON,
) -> tuple[FloatArray, FloatArray]:
    """Return what units of bias add to pictures, (k, 2, biases), and their sigmas [px], (biases,).

    Sightings have azimuths [rad], the place of their marker among those seen, and how far out
    their cable may lie from where it is expected [px], shape (k,); for cuts see `cut_off`, `common`
    is the prior of what all bands have in common [px].
    """
    sine = np.sin(azimuth)
    curves = np.array([np.ones(sine.size), sine, 2.0 * sine**2 - 1.0])
    groups: list[tuple[FlagArray, Sigmas]] = [(np.ones(sine.size, dtype=bool), common)]
    even, (along, across), bent = OF_MARKER
    for i in np.unique(row):
        out = math.hypot(along, float(lifted[row == i].max()))
        groups.append((row == i, (even, (out, across), bent)))
    groups += [(cut, OF_CUT) for cut in cuts if cut.any()]
    members = np.array([group for group, _ in groups], dtype=float)
    shapes = np.einsum("gk,sk,ab->kagsb", members, curves, np.eye(2))
    sigmas = [np.broadcast_to(sigma, (len(curves), 2)) for _, sigma in groups]
    return shapes.reshape(sine.size, 2, -1), np.ravel(sigmas)
