"""Robust least squares: Gauss-Newton with weights that fall with the misfit (Cauchy)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.estimator.problem import Problem

# So many deviations are no chance: one number in 370 is as far off. Such a sighting counts half.
SURE = 3.0
# The cost of a good step falls by more than this, else the fit has settled.
_SETTLED = 0.2
_STEPS = 16
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


def fitted(
    problem: Problem, prior: FloatArray, start: FloatArray, centre: FloatArray | None = None
) -> Fit:
    """Return the unknowns of least cost.

    The prior's inverse variances, zero for markers, its centre, zero if None, and the unknowns to
    start at have the shape (unknowns,).
    """
    centre = np.zeros(prior.size) if centre is None else centre
    best = _at(problem, prior, centre, start)
    for _ in range(_STEPS):
        pull = best.gradient - prior * (best.x - centre)
        step = np.linalg.solve(best.normal + np.diag(prior + LEAST_INFORMATION), pull)
        for share in (1.0, 0.3):
            found = _at(problem, prior, centre, best.x + share * step)
            if found.cost < best.cost:
                break
        else:
            return best
        gained = best.cost - found.cost
        best = found
        if gained < _SETTLED:
            break
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
        rest=float(np.quantile(square, 0.8)),
    )
