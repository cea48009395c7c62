"""Equilibrium and small vibrations of a rod: Newton's method on the explicit model's own forces.

Stiffness comes from central differences of the model's forces, so statics and frequencies check
the very elements that the explicit integration uses.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from winding_verification.rod.rod import Rod


def equilibrium(
    rod: Rod, *, increments: int = 10, tolerance: float = 1.0e-9, iterations: int = 100
) -> None:
    """Move a rod to its equilibrium under its loads, end moments and gravity (no contact).

    Args:
        rod: Changed in place.
        increments: Steps in which loads are raised from zero.
        tolerance: Relative: unbalanced force over the greatest force in the rod.
        iterations: Newton iterations per increment.

    Raises:
        DivergenceError: No equilibrium was found.
    """
    loads, gravity = rod.load.copy(), rod.gravity.copy()
    moments = rod._ends.moment.copy()
    try:
        for k in range(1, increments + 1):
            share = k / increments
            rod.load[:], rod.gravity[:] = share * loads, share * gravity
            rod._ends.moment[:] = share * moments
            _newton(rod, tolerance, iterations)
    finally:
        rod.load[:], rod.gravity[:], rod._ends.moment[:] = loads, gravity, moments


def stiffness(rod: Rod) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return tangent stiffness and mass of the free unknowns, and their places.

    Unknowns are x of all nodes, y, z, then the twist angles of a rod that has them.
    """
    unknown = _unknowns(rod)
    size = unknown.size
    matrix = np.empty((size, size))
    length = float(rod._mesh.reference.min())
    nodes3 = 3 * rod.mass.size
    for column, index in enumerate(unknown):
        delta = 1.0e-6 * length if index < nodes3 else 1.0e-6
        _displace(rod, index, delta)
        ahead = _residual(rod)[unknown]
        _displace(rod, index, -delta)
        _displace(rod, index, -delta)
        behind = _residual(rod)[unknown]
        _displace(rod, index, delta)
        matrix[:, column] = (behind - ahead) / (2.0 * delta)
    mass = np.concatenate([np.tile(rod.mass, 3), rod.spin_inertia if rod.framed else []])
    return matrix, mass[unknown], unknown


def frequencies(rod: Rod, count: int = 6) -> FloatArray:
    """Return the lowest natural frequencies [Hz] about the present state, rigid modes as zero."""
    matrix, mass, _ = stiffness(rod)
    scale = 1.0 / np.sqrt(mass)
    values = eigh(scale[:, None] * _symmetric(matrix) * scale, eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(values[:count], 0.0)) / (2.0 * math.pi))


def lowest_stiffness(rod: Rod) -> float:
    """Return the least eigenvalue of the tangent stiffness: negative where the rod buckles."""
    matrix = _symmetric(stiffness(rod)[0])
    return float(eigh(matrix, eigvals_only=True, subset_by_index=(0, 0))[0])


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (matrix + matrix.T))


def _newton(rod: Rod, tolerance: float, iterations: int) -> None:
    unknown = _unknowns(rod)
    left = math.inf
    for _ in range(iterations):
        residual = _residual(rod)[unknown]
        # Rounding of the axial springs leaves 1e-13 of EA whatever the loads are.
        scale = max(rod.force_scale(), 1.0e-3 * rod.section.young * rod.section.area)
        left = float(np.abs(residual).max()) / scale
        if left < tolerance:
            return
        matrix, _, _ = stiffness(rod)
        step = np.linalg.solve(matrix, residual)
        limit = 2.0 * float(rod._mesh.reference.min())
        most = float(np.abs(step).max())
        _shift(rod, unknown, np.asarray(step * min(1.0, limit / most)))
    raise DivergenceError(
        f"no equilibrium after {iterations} Newton iterations: {left:.2g} of the force is left"
    )


def _unknowns(rod: Rod) -> NDArray[np.intp]:
    free = rod._free.ravel() > 0.0
    if rod.framed:
        free = np.concatenate([free, rod._ends.spin_free[1:-1] > 0.0])
    return np.flatnonzero(free)


def _shift(rod: Rod, unknown: NDArray[np.intp], step: FloatArray) -> None:
    whole = np.zeros(3 * rod.mass.size + rod.mass.size - 1)
    whole[unknown] = step
    nodes3 = 3 * rod.mass.size
    rod.points.position[:] += whole[:nodes3].reshape(3, -1)
    if rod.framed:
        rod.spin_angles[:] += whole[nodes3:]
    rod.internal_forces()


def _displace(rod: Rod, index: int, delta: float) -> None:
    """Displace one unknown, in [m] or [rad]."""
    nodes3 = 3 * rod.mass.size
    if index < nodes3:
        rod.points.position.reshape(-1)[index] += delta
    else:
        rod.spin_angles[index - nodes3] += delta


def _residual(rod: Rod) -> FloatArray:
    """Return the net forces; the rod's frames stay as they are."""
    if not rod.framed:
        return np.asarray(rod._net_forces().ravel())
    scratch = rod._scratch
    frames = (scratch.director, scratch.carried, scratch.own_twist)
    kept = [frame.copy() for frame in frames]
    net = np.concatenate([rod._net_forces().ravel(), scratch.torque[1:-1]])
    for frame, before in zip(frames, kept, strict=True):
        frame[:] = before
    return net
