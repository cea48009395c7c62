"""Moments and quantiles of weighted draws."""

from __future__ import annotations

import numpy as np

from cable_fem_node.dynamics.points import FloatArray


def covariance_of(table: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the covariance of the columns, shape (k, k).

    Args:
        table: Draws, shape (n, k).
        weights: Sum one, shape (n,).
    """
    off = table - weights @ table
    return np.asarray((off * weights[:, None]).T @ off)


def interval_of(values: FloatArray, weights: FloatArray, level: float = 0.9) -> tuple[float, float]:
    """Return the central interval of a level.

    Args:
        values: Draws, shape (n,).
        weights: Sum one, shape (n,).
        level: Probability inside.
    """
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    low, high = np.interp([0.5 - 0.5 * level, 0.5 + 0.5 * level], below, values[order])
    return float(low), float(high)
