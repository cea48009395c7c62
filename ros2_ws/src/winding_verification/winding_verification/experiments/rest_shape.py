"""What a shape at rest or in motion tells of the unstressed one."""

from __future__ import annotations

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from winding_verification.rod.rod import Rod

# How far a cable's inertia may stand in for gravity [m/s^2], against a curvature [1/m].
_ACCELERATION, _CURVATURE = 3.0, 1.0


def shape_of_its_own(rod: Rod) -> FloatArray:
    """Return integrated curvatures (2, n) [rad] that no moment explains, beyond the natural ones.

    Bending moments along a cable follow from force and moment at its start, from its weight and
    from its acceleration, here the same everywhere:

        M(s) = M0 - (x - x0) x F0 + int t x (g - a) rho A s ds.

    M0, F0 and a are those that leave the least curvature besides; what they leave is returned.

    Args:
        rod: Framed, clamped at both ends, with gravity and its natural curvature.
    """
    place = rod.nodes
    edges = np.diff(place, axis=0)
    arc = np.concatenate([[0.0], np.cumsum(rod.reference)])
    middle = 0.5 * (arc[1:] + arc[:-1])
    by_mass = rod.section.density * rod.section.area
    unit = np.eye(3)
    columns = [np.tile(axis, (place.shape[0], 1)) for axis in unit]
    columns += [-np.cross(place - place[0], axis) for axis in unit]
    weights = []
    for axis in unit:
        turning = by_mass * middle[:, None] * np.cross(edges, axis)
        weights.append(np.concatenate([np.zeros((1, 3)), np.cumsum(turning, axis=0)]))
    columns += [-weight for weight in weights]
    first, second = rod.directors()

    def bent(moment: FloatArray) -> FloatArray:
        along = np.concatenate([(moment.T * second).sum(axis=0), -(moment.T * first).sum(axis=0)])
        return np.asarray(along / rod.section.bending)

    weight = sum(pull * column for pull, column in zip(rod.gravity, weights, strict=True))
    lengths = np.tile(rod.voronoi, 2)
    left = (rod.curvatures() - rod.natural)[:2].ravel() / lengths - bent(np.asarray(weight))
    matrix = np.stack([bent(column) for column in columns], axis=1)
    by_length = np.sqrt(lengths) / _CURVATURE
    held = np.zeros((3, 9))
    held[:, 6:] = unit / _ACCELERATION
    solved, *_ = np.linalg.lstsq(
        np.concatenate([by_length[:, None] * matrix, held]),
        np.concatenate([by_length * left, np.zeros(3)]),
        rcond=None,
    )
    return np.asarray((lengths * (left - matrix @ solved)).reshape(2, -1))
