"""How far measured and wound markers may lie apart: covariances, and scatter beyond them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.identification.tracked_run import TrackedRun

# An angle that is wrong by half of itself is no scatter any more.
_MOST_SCATTER = 0.5


def angle_covariance(
    runs: Sequence[TrackedRun], model_share: float, scatter: float = 0.0
) -> FloatArray:
    """Return the covariance of all angles' residuals [rad^2], shape (n, n).

    Args:
        runs: Their markers follow each other.
        model_share: Relative standard error of the model, common to all markers of a run.
        scatter: Relative standard deviation of each marker by itself, beyond the tracker's.
    """
    from scipy.linalg import block_diag  # noqa: PLC0415 - see `Search.run`

    blocks = []
    for run in runs:
        theta = run.readings.theta
        own = np.diag(run.readings.sigma_theta**2 + (scatter * theta) ** 2)
        blocks.append(own + model_share**2 * np.outer(theta, theta))
    return np.asarray(block_diag(*blocks))


def axial_covariance(runs: Sequence[TrackedRun], model_z: float) -> FloatArray:
    """Return the covariance of all z residuals [m^2], shape (n, n)."""
    return np.diag(np.concatenate([run.readings.sigma_z**2 + model_z**2 for run in runs]))


def chi_square(left: FloatArray, covariance: FloatArray) -> float:
    """Return the generalised sum of squares of residuals (m,) with covariance (m, m)."""
    return float(left @ np.linalg.solve(covariance, left))


def scatter_of(
    left: FloatArray, degrees: int, runs: Sequence[TrackedRun], model_share: float
) -> float:
    """Return the scatter with which the residuals are as large as expected.

    Mandel and Paule, J. Res. Natl. Bur. Stand. 87, 1982: the extra variance for which chi-square
    equals its degrees of freedom.

    Args:
        left: Residuals of all angles [rad], whose chi-square without scatter exceeds `degrees`.
        degrees: Angles less parameters, at least 1.
        runs: Where they come from.
        model_share: See `angle_covariance`.
    """
    from scipy.optimize import brentq  # noqa: PLC0415 - see `Search.run`

    def excess(scatter: float) -> float:
        return chi_square(left, angle_covariance(runs, model_share, scatter)) - degrees

    if excess(_MOST_SCATTER) > 0.0:
        return _MOST_SCATTER
    return float(brentq(excess, 0.0, _MOST_SCATTER, xtol=1.0e-7))
