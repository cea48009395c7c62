"""Where the search ends, the test of its residuals, and how well the parameters are known."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.search import (
    RodExcess,
    Search,
    angle_covariance,
    chi_square,
    scatter_of,
)
from cable_fem_node.identification.tracked_run import TrackedRun

NORMAL_90 = 1.6448536269514722


@dataclass(frozen=True, kw_only=True)
class MarkerResidual:
    """One marker of a run: where it was measured and where the fitted rod puts it."""

    run: int  # Index of the run
    id: int  # n of Pn
    theta: float  # Measured [rad]
    theta_fitted: float  # [rad]
    z: float  # Measured [m]
    z_fitted: float  # [m]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Outcome of a search."""

    parameters: FloatArray  # Shape (p,)
    # From the deviations of tracker and model, and from the scatter, shape (p, p).
    covariance: FloatArray
    quantile: float  # Factor from a standard error to the half width of a 90 % interval
    residuals: tuple[MarkerResidual, ...]  # Every marker of every run
    chi_square: float  # Of the angles under the assumed deviations
    degrees: int  # Angles less parameters
    misfit: bool  # Whether the residuals contradict the assumed deviations
    # Relative standard deviation of each angle beyond the assumed ones; zero without a misfit.
    scatter: float
    calls: int  # Calls of the rod per run
    # The rod's last answer, for the next search of the same run; None of several runs.
    excess: RodExcess | None = None

    @property
    def worst_share(self) -> float:
        """Greatest residual of an angle relative to the angle."""
        return max(abs(row.theta_fitted / row.theta - 1.0) for row in self.residuals)


def fit(search: Search, start: FloatArray) -> Fit:
    """Return the parameters whose rod lays the markers of all runs where they were measured.

    Where the residuals contradict the assumed deviations, every marker is given a scatter of its
    own, as large as the residuals ask for, and the search is repeated with it.

    Args:
        search: Not yet run.
        start: Where it begins, shape (p,).

    Raises:
        IdentificationError: The search does not come to rest, or the rod fails.
        AbandonedError: `going` returned False.
    """
    from scipy.special import chdtrc, stdtrit  # noqa: PLC0415 - see `load_search`

    runs, config = search.runs, search.config
    low, high = search.bounds
    search.run(np.clip(start, low + 1.0e-9, high - 1.0e-9), scatter=0.0)
    angles = search.measured.size // 2
    left = (search.fitted - search.measured)[:angles]
    squares = chi_square(left, angle_covariance(runs, config.model_share))
    degrees = angles - search.parameters.size
    misfit = degrees > 0 and float(chdtrc(degrees, squares)) < config.misfit_level
    scatter = 0.0
    if misfit:
        scatter = scatter_of(left, degrees, runs, config.model_share)
        search.run(search.parameters, scatter)
    return Fit(
        parameters=search.parameters,
        covariance=search.covariance,
        # Scatter estimated from the residuals themselves has their few degrees of freedom.
        quantile=float(stdtrit(degrees, 0.95)) if misfit else NORMAL_90,
        residuals=_residuals(runs, search.fitted),
        chi_square=squares,
        degrees=degrees,
        misfit=misfit,
        scatter=scatter,
        calls=search.calls,
        excess=search.excess,
    )


def _residuals(runs: Sequence[TrackedRun], fitted: FloatArray) -> tuple[MarkerResidual, ...]:
    theta, z = np.split(fitted, 2)
    rows: list[MarkerResidual] = []
    for number, run in enumerate(runs):
        readings = run.readings
        for i, marker in enumerate(readings.ids.tolist()):
            place = len(rows)
            rows.append(
                MarkerResidual(
                    run=number,
                    id=marker,
                    theta=float(readings.theta[i]),
                    theta_fitted=float(theta[place]),
                    z=float(readings.z[i]),
                    z_fitted=float(z[place]),
                )
            )
    return tuple(rows)


def half_width(standard_error: float, quantile: float) -> float:
    """Return the greater half of a 90 % interval of exp(x), relative to exp of the estimate.

    Args:
        standard_error: Of x, dimensionless.
        quantile: See `Fit`.
    """
    return math.expm1(min(quantile * standard_error, 50.0))
