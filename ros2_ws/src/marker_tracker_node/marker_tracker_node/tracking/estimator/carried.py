"""The part of a fitted change that the data carry, whatever was believed before."""

from __future__ import annotations

import numpy as np

from marker_tracker_node.arrays import FloatArray, IndexArray
from marker_tracker_node.tracking.estimator.fit import LEAST_INFORMATION, Fit


def data_information(fit: Fit, chosen: IndexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what the sightings alone know of chosen unknowns of a fit, of places of shape (n,).

    That is the information on them without their prior, (n, n); what a change of them takes off
    every other unknown, (others, n); and the information on the others, (others, others).
    """
    rest = np.delete(np.arange(fit.x.size), chosen)
    others = fit.normal[np.ix_(rest, rest)] + np.diag(fit.prior[rest] + LEAST_INFORMATION)
    across = fit.normal[np.ix_(rest, chosen)]
    follow = np.asarray(np.linalg.solve(others, across), dtype=float)
    return fit.normal[np.ix_(chosen, chosen)] - across.T @ follow, follow, others


def carried_correction(
    data: FloatArray, best: FloatArray, nominal: FloatArray, sigmas: FloatArray, least: float
) -> tuple[FloatArray, FloatArray]:
    """Return the part of a fitted change of numbers that the data carry, and its covariance.

    In units of the doubts the data's information has axes of its own. Along one of them the change
    is taken whole if it is `least` standard deviations of the data or more, and else left out:
    right numbers are then left alone. What was left out counts as error.

    Args:
        data: Information on the numbers without any prior, shape (numbers, numbers).
        best: Fitted change from the present numbers, shape (numbers,).
        nominal: Change that would lead to the configured ones, shape (numbers,).
        sigmas: How well those were known, one standard deviation, shape (numbers,); zero where they
            are held.
        least: See above.
    """
    free = sigmas > 0.0
    moved, covariance = np.zeros(sigmas.size), np.zeros((sigmas.size, sigmas.size))
    moved[~free] = nominal[~free]
    if not free.any():
        return moved, covariance
    unit = sigmas[free]
    information = data[np.ix_(free, free)] * np.outer(unit, unit)
    strength, axes = np.linalg.eigh(0.5 * (information + information.T))
    strength = np.maximum(strength, 0.0)
    change = axes.T @ (best[free] / unit)
    # The data alone would go further than the compromise with the prior does.
    centre = axes.T @ (nominal[free] / unit)
    alone = change + (change - centre) / np.maximum(strength, 1.0e-12)
    carried = np.abs(alone) * np.sqrt(strength) >= least
    taken = np.where(carried, change, 0.0)
    variance = 1.0 / (1.0 + strength) + (change - taken) ** 2
    moved[free] = unit * (axes @ taken)
    covariance[np.ix_(free, free)] = np.outer(unit, unit) * ((axes * variance) @ axes.T)
    return moved, covariance
