"""How deep nodes lie in what they touch, and the forces and energies of the springs there."""

import math

import numpy as np

from cable_fem_node.dynamics.compile import kernel
from cable_fem_node.dynamics.state import (
    BELOW_ROWS,
    GONE,
    MOST_BELOW,
    ContactLaw,
    FloatArray,
    Points,
)


def normal_forces(points: Points, touch: ContactLaw) -> FloatArray:
    """Return with which force [N] the penalty springs of every node push, shape (nodes,)."""
    deep = depths(points, touch)
    return np.asarray(
        touch.normal_stiffness * deep[0] + touch.beside_stiffness * deep[1:].sum(axis=0)
    )


def contact_energy(points: Points, touch: ContactLaw) -> float:
    """Return the energy [J] in the normal and stick springs of all nodes."""
    deep = (depths(points, touch) ** 2).sum(axis=1)
    slip = points.slip[:, points.touching == 1]
    return 0.5 * (
        touch.normal_stiffness * float(deep[0])
        + touch.beside_stiffness * float(deep[1:].sum())
        + touch.stick_stiffness * float((slip**2).sum())
    )


def lying_energy(points: Points, touch: ContactLaw, nodes: int) -> float:
    """Return the energy [J] in the springs between the first nodes and the cable below."""
    deep = depths(points, touch)[1:-1, :nodes]
    return 0.5 * touch.beside_stiffness * float((deep**2).sum())


@kernel
def depths(points: Points, touch: ContactLaw) -> FloatArray:  # pragma: no cover
    """Return how deep nodes lie [m] in the cylinder, in cable below and in a flange, (k, nodes)."""
    z, below = points.position[2], points.below
    radius = np.hypot(points.position[0], points.position[1])
    deep = np.zeros((2 + MOST_BELOW * int(below.size > 0), radius.size))
    outside = np.maximum(radius, touch.line)
    line = radius - (touch.chords - touch.line) * touch.line / outside
    for i in range(radius.size):
        if points.touching[i] == 1:
            deep[0, i] = max(points.contact_radius[i] - radius[i], 0.0)
        if radius[i] < touch.rim:
            deep[-1, i] = max(touch.low - z[i], z[i] - touch.high, 0.0)
        for n in range(len(deep) - 2):
            held, there, rise, slope, least, element, share, _ = below[
                BELOW_ROWS * n : BELOW_ROWS * (n + 1), i
            ]
            if least == 0.0:
                continue
            at, gone = held, below[GONE, i]
            if element >= 0.0:
                k = int(element)
                at = line[k] + share * (line[k + 1] - line[k])
                there = z[k] + share * (z[k + 1] - z[k])
                gone -= below[GONE, k] + share * (below[GONE, k + 1] - below[GONE, k])
            above = 2.0 * points.contact_radius[i] - touch.chords - touch.line
            up = radius[i] - above * touch.line / outside[i] - at - rise * gone
            aside = z[i] - there - slope * gone
            along = (up * rise + aside * slope) ** 2 / (held**2 + rise**2 + slope**2)
            apart = math.sqrt(max(up**2 + aside**2 - along, 0.0))
            deep[1 + n, i] = max(least - apart, 0.0)
    return deep
