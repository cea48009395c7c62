"""Robust least squares, and the part of a fitted change that the data carry.

Gauss-Newton with weights that fall with the misfit (Cauchy).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from marker_tracker_node.arrays import FloatArray, IndexArray
from marker_tracker_node.tracking.estimator.problem import Problem

# So many deviations are no chance: one number in 370 is as far off. Such a sighting counts half.
SURE = 3.0
# What holds in so many is usual: outliers, and what is new since, are a fifth at most.
USUAL = 0.8
# The cost of a good step falls by more than this, else the fit has settled.
_SETTLED = 0.2
# With fewer sightings nothing is estimated.
LEAST_ROWS = 12
# So much is known of everything, for numbers that nothing else tells.
LEAST_INFORMATION = 1.0e-9


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Unknowns that explain the sightings best under a prior."""

    x: FloatArray  # Unknowns, see `Problem`
    prior: FloatArray  # Inverse variances under which they do
    cost: float  # Twice the negative logarithm of their likelihood, with the prior
    normal: FloatArray  # Information on them without the prior, shape (unknowns, unknowns)
    gradient: FloatArray  # Of the sightings at x, shape (unknowns,)
    rest: float  # Square of what is left of four sightings in five at most, in its variance

    @property
    def covariance(self) -> FloatArray:
        """Of the unknowns under the prior, shape (unknowns, unknowns)."""
        return np.asarray(np.linalg.inv(self.normal + np.diag(self.prior + LEAST_INFORMATION)))

    def information(self, chosen: IndexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what the sightings alone know of chosen unknowns, of places of shape (n,).

        That is the information on them without their prior, (n, n); what a change of them takes off
        every other unknown, (others, n); and the information on the others, (others, others).
        """
        rest = np.delete(np.arange(self.x.size), chosen)
        others = self.normal[np.ix_(rest, rest)] + np.diag(self.prior[rest] + LEAST_INFORMATION)
        across = self.normal[np.ix_(rest, chosen)]
        follow = np.asarray(np.linalg.solve(others, across), dtype=float)
        return self.normal[np.ix_(chosen, chosen)] - across.T @ follow, follow, others


def fitted(
    problem: Problem, prior: FloatArray, start: FloatArray, centre: FloatArray | None = None
) -> Fit:
    """Return the unknowns of least cost.

    The prior's inverse variances, zero for markers, its centre, zero if None, and the unknowns to
    start at have the shape (unknowns,).
    """
    centre = np.zeros(prior.size) if centre is None else centre
    best = _at(problem, prior, centre, start)
    gained = math.inf
    while gained >= _SETTLED:
        pull = best.gradient - prior * (best.x - centre)
        step = np.linalg.solve(best.normal + np.diag(prior + LEAST_INFORMATION), pull)
        for share in (1.0, 0.5):
            found = _at(problem, prior, centre, best.x + share * step)
            if found.cost < best.cost:
                break
        else:
            return best
        gained = best.cost - found.cost
        best = found
    return best


def _at(problem: Problem, prior: FloatArray, centre: FloatArray, x: FloatArray) -> Fit:
    off, slopes = problem.linearised(x)
    square = (off**2).sum(axis=1) / problem.sigma**2
    cost = SURE**2 * float(np.log1p(square / SURE**2).sum())
    area, by_area = problem.area(x)
    # The root of a Cauchy weight, over the deviation.
    weight = (1.0 + square / SURE**2) ** -0.5 / problem.sigma
    flat = (slopes * weight[:, None, None]).reshape(-1, x.size)
    return Fit(
        x=x,
        prior=prior,
        cost=cost + area**2 + float(prior @ (x - centre) ** 2),
        normal=flat.T @ flat + np.outer(by_area, by_area),
        gradient=flat.T @ (off * weight[:, None]).ravel() + area * by_area,
        rest=float(np.quantile(square, USUAL)),
    )


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
