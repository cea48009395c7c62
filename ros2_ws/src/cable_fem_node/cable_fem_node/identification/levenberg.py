"""Levenberg and Marquardt's search from several starts at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cable_fem_node.dynamics.state import FloatArray

# No coordinate moves farther in one step: they are normal deviates and logarithms.
_FARTHEST_STEP = 1.5


def optimum(
    residuals: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    *,
    probe: float,
    steps: int,
    settled: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the coordinates with the smallest sums of squares, and what is known of them there.

    Slopes are forward differences. A search ends when all its next steps promise less than twice
    a gain, whether or not rounding lets that be seen.

    Args:
        residuals: Returns standard normal residuals, shape (c, k + 1, m), at coordinates, shape
            (c, k + 1, k).
        start: Coordinates, shape (c, k).
        probe: Length of a forward difference, in coordinates [1].
        steps: Most of them.
        settled: Twice the gain in half a sum of squares [1] below which no step is taken.

    Returns:
        Coordinates, shape (c, k); information, shape (c, k, k); half the sums of squares, (c,).
    """
    count, size = start.shape
    probes = np.vstack([np.zeros(size), probe * np.eye(size)])

    def around(q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        rows = residuals(q[:, None, :] + probes)
        base = rows[:, 0]
        return base, (rows[:, 1:] - base[:, None]) / probe, 0.5 * (base**2).sum(axis=1)

    q = start
    base, slope, cost = around(q)
    damping = np.full(count, 1.0e-3)
    for _ in range(steps):
        information = slope @ slope.transpose(0, 2, 1)
        diagonal = np.einsum("cii->ci", information)
        damped = information + (damping[:, None] * diagonal)[:, None] * np.eye(size)
        pull = np.einsum("cij,cj->ci", slope, base)
        step = -np.linalg.solve(damped, pull[..., None])[..., 0]
        step = np.clip(step, -_FARTHEST_STEP, _FARTHEST_STEP)
        if np.max(-np.einsum("ci,ci->c", pull, step)) < settled:
            break
        tried = around(q + step)
        better = tried[2] < cost
        q = np.where(better[:, None], q + step, q)
        base = np.where(better[:, None], tried[0], base)
        slope = np.where(better[:, None, None], tried[1], slope)
        cost = np.where(better, tried[2], cost)
        damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1.0e-9, 1.0e6)
    return q, slope @ slope.transpose(0, 2, 1), cost
