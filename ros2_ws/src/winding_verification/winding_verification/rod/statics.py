"""Equilibrium and small vibrations of a rod: Newton's method on the explicit model's own forces.

Stiffness comes from central differences of the model's forces, so statics and frequencies check
the very elements that the explicit integration uses.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from winding_verification.rod.rod import Rod


def equilibrium(rod: Rod, *, increments: int = 10) -> None:
    """Move a rod to its equilibrium under its loads, end moments and gravity (no contact).

    Raises:
        DivergenceError: No equilibrium was found.
    """
    unknown = _unknowns(rod)
    limit = 2.0 * float(rod._mesh.reference.min())

    def take_step(residual: FloatArray) -> None:
        step = np.asarray(np.linalg.solve(stiffness(rod)[0], residual), dtype=float)
        _displace(rod, unknown, step * min(1.0, limit / float(np.abs(step).max())))
        rod.internal_forces()

    balance(
        (rod.load, rod.gravity, rod._ends.moment),
        lambda: _residual(rod)[unknown],
        # Rounding of the axial springs leaves 1e-13 of EA whatever the loads are.
        lambda: max(rod.force_scale(), 1.0e-3 * rod.section.young * rod.section.area),
        take_step,
        increments=increments,
    )


def balance(
    loads: Sequence[FloatArray],
    residual: Callable[[], FloatArray],
    scale: Callable[[], float],
    take_step: Callable[[FloatArray], None],
    *,
    increments: int,
    tolerance: float = 1.0e-9,
    iterations: int = 100,
) -> None:
    """Balance the forces of a model by Newton's method, its loads raised in equal steps from zero.

    Args:
        loads: Of the model, any shapes; they are whole again in the end.
        residual: Returns the forces of the free unknowns that are not balanced, shape (n,).
        scale: Returns the greatest force in the model.
        take_step: Moves the model by Newton's step for a residual.
        increments: Steps in which loads are raised.
        tolerance: Relative: unbalanced force over the greatest one.
        iterations: Newton iterations per increment.

    Raises:
        DivergenceError: No equilibrium was found.
    """
    whole = [load.copy() for load in loads]
    try:
        for k in range(1, increments + 1):
            for load, full in zip(loads, whole, strict=True):
                load[:] = k / increments * full
            for _ in range(iterations):
                forces = residual()
                left = float(np.abs(forces).max()) / scale()
                if left < tolerance:
                    break
                take_step(forces)
            else:
                raise DivergenceError(
                    f"no equilibrium after {iterations} Newton iterations: {left:.2g} of the "
                    "force is left"
                )
    finally:
        for load, full in zip(loads, whole, strict=True):
            load[:] = full


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
        _displace(rod, index, -2.0 * delta)
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


def _unknowns(rod: Rod) -> NDArray[np.intp]:
    free = rod._free.ravel() > 0.0
    if rod.framed:
        free = np.concatenate([free, rod._ends.spin_free[1:-1] > 0.0])
    return np.flatnonzero(free)


def _displace(rod: Rod, places: NDArray[np.intp], by: float | FloatArray) -> None:
    """Displace unknowns, in [m] or [rad]."""
    whole = np.zeros(4 * rod.mass.size - 1)
    whole[places] = by
    nodes3 = 3 * rod.mass.size
    rod.points.position[:] += whole[:nodes3].reshape(3, -1)
    if rod.framed:
        rod.spin_angles[:] += whole[nodes3:]


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
