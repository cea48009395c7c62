"""Equilibrium and small vibrations of a solid: Newton's method on the explicit element's forces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import eigsh, splu

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from cable_fem_node.solid.hex_kernels import hex_stiffness
from cable_fem_node.solid.solid import Solid


def solid_equilibrium(
    solid: Solid, *, increments: int = 4, tolerance: float = 1.0e-8, iterations: int = 40
) -> None:
    """Move a solid to its equilibrium under its loads and gravity (no contact).

    Driven axes of nodes stay where they are.

    Raises:
        DivergenceError: No equilibrium was found.
    """
    loads, gravity = solid.load.copy(), solid.gravity.copy()
    try:
        for k in range(1, increments + 1):
            share = k / increments
            solid.load[:], solid.gravity[:] = share * loads, share * gravity
            _newton(solid, tolerance, iterations)
    finally:
        solid.load[:], solid.gravity[:] = loads, gravity


def solid_stiffness(solid: Solid) -> csc_matrix:
    """Return the tangent stiffness of all unknowns, node * 3 + axis [N/m].

    Raises:
        DivergenceError: An element is inside out.
    """
    count = solid.volumes.size
    matrix = np.empty((count, 24, 24))
    size = float(np.cbrt(solid.volumes.min()))
    if hex_stiffness(solid.points.position, solid._mesh, 1.0e-6 * size, matrix) >= 0:
        raise DivergenceError("an element is inside out: no stiffness")
    places = (3 * solid.hexes[:, :, None] + np.arange(3)).reshape(count, 24)
    rows = np.repeat(places, 24, axis=1).ravel()
    columns = np.tile(places, (1, 24)).ravel()
    whole = 3 * solid.mass.size
    return coo_matrix((matrix.ravel(), (rows, columns)), shape=(whole, whole)).tocsc()


def solid_frequencies(solid: Solid, count: int = 6) -> FloatArray:
    """Return the lowest natural frequencies [Hz] about the present state."""
    free = _free(solid)
    matrix = solid_stiffness(solid)[free][:, free]
    matrix = 0.5 * (matrix + matrix.T)
    mass = diags(np.repeat(solid.mass, 3)[free]).tocsc()
    shift = -1.0e-6 * float(abs(matrix.diagonal()).max() / mass.diagonal().max())
    values = eigsh(matrix, k=count, M=mass, sigma=shift, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.maximum(np.sort(values), 0.0)) / (2.0 * math.pi))


def _free(solid: Solid) -> NDArray[np.intp]:
    return np.flatnonzero(solid._free.T.ravel() > 0.0)


def _newton(solid: Solid, tolerance: float, iterations: int) -> None:
    free = _free(solid)
    left = math.inf
    size = float(np.cbrt(solid.volumes.min()))
    for _ in range(iterations):
        net = solid._net_forces().T.ravel()
        left = float(np.abs(net[free]).max()) / max(solid.force_scale(), 1.0e-30)
        if left < tolerance:
            return
        matrix = solid_stiffness(solid)[free][:, free]
        step = splu(matrix).solve(net[free])
        # A node may not jump over an element; rigid swings of far nodes may.
        step *= min(1.0, 20.0 * size / float(np.abs(step).max()))
        _search(solid, free, step, float(np.linalg.norm(net[free])))
    raise DivergenceError(
        f"no equilibrium after {iterations} Newton iterations: {left:.2g} of the force is left"
    )


def _search(solid: Solid, free: NDArray[np.intp], step: FloatArray, before: float) -> None:
    """Take the greatest halving of a step that does not raise the unbalanced force tenfold."""
    start = solid.points.position.copy()
    moved = np.zeros(start.size)
    for halving in range(12):
        moved[free] = step * 0.5**halving
        solid.points.position[:] = start + moved.reshape(-1, 3).T
        try:
            net = solid._net_forces().T.ravel()[free]
        except DivergenceError:
            continue
        if float(np.linalg.norm(net)) < 10.0 * before:
            return
