"""Inverse winding: least squares over the rod, whose closed form gives the way and the slope.

One call of the rod costs half a processor second, one of the closed form a millisecond. So the
closed form, corrected by the rod's result for the last tried material and by the change of that
since the one before, is what scipy's least_squares sees; the rod is evaluated again at the optimum
until that stands still. There the residuals are the rod's own (space mapping, Bandler et al.,
IEEE Trans. Microwave Theory Tech. 42, 1994; the change is Broyden's rank-one update).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.quasi_static import lay
from cable_fem_node.identification.rod_run import wind
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from winding_core.cable.material_law import MaterialLaw

# An angle that is wrong by half of itself is no scatter any more.
_MOST_SCATTER = 0.5
Family = Callable[[FloatArray], MaterialLaw]
# The first parameter is the logarithm of a modulus. Where its standard error is greater, the
# search would wander among cables so stiff that they do not bend around the cylinder.
_BLIND = 0.7
# Over a shorter way than this the rod's steps, whose number is whole, give no slope.
_SHORTEST = 0.01


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


@dataclass(frozen=True, kw_only=True)
class RodExcess:
    """How far a run's rod markers lie from the closed form's, at the last tried material."""

    parameters: FloatArray  # Of the material, shape (p,)
    ids: NDArray[np.int64]  # n of Pn, ascending, shape (m,)
    excess: FloatArray  # Of the angles relative to the closed form's, then of z [m], shape (2 m,)
    slope: FloatArray  # Its change per parameter, shape (2 m, p)

    def expected_for(self, ids: NDArray[np.int64]) -> RodExcess:
        """Return what is to be expected of markers, which may have become more, shape (k,).

        A share of the angle and a distance along the axis change little from one marker to the
        next: one without a result of the rod takes those of the nearest before it.
        """
        nearest = np.maximum(np.searchsorted(self.ids, ids, side="right") - 1, 0)
        rows = np.concatenate([nearest, nearest + self.ids.size])
        return RodExcess(
            parameters=self.parameters, ids=ids, excess=self.excess[rows], slope=self.slope[rows]
        )


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """Assumed deviations of model and tracker, and limits of the search."""

    # Standard error of the rod's angles relative to themselves, common to all markers of a run:
    # over strains of 0.02 to 1.2 a rod of 5 mm elements differs from one of 2.5 mm by 0.0005 rms
    # and 0.0009 at most. One cable always has the same error, so the greater half of them is what
    # counts.
    model_share: float = 7.0e-4
    # Standard error of the rod's z [m]: one free length explains the twelve published series within
    # 1.5 mm.
    model_z: float = 1.5e-3
    # The search ends when a step is shorter than this share of the standard error.
    tolerance: float = 0.3
    max_calls: int = 6  # Most calls of the rod per run
    # Residuals that chance reaches more rarely than this contradict the assumed deviations.
    misfit_level: float = 0.01


@dataclass(eq=False)
class Search:
    """Alternates between the corrected closed form and the rod; angles come first, then z."""

    runs: Sequence[TrackedRun]  # At least one
    family: Family  # Material with parameters, shape (p,)
    bounds: tuple[FloatArray, FloatArray]  # Least and greatest parameters, shape (p,) each
    config: FitConfig = field(default_factory=FitConfig)  # Assumed deviations and limits
    # Returns whether the result is still wanted; called repeatedly
    going: Callable[[], bool] = lambda: True
    # The rod's excess in an earlier search of the same run, when it had fewer markers; the search
    # begins there, and one call of the rod confirms it
    before: RodExcess | None = None

    def __post_init__(self) -> None:
        self.measured = _in_order([(run.readings.theta, run.readings.z) for run in self.runs])
        self._angles = np.arange(self.measured.size) < self.measured.size // 2
        # How the rod differs from the closed form: at the last call, and per parameter.
        self._asked_at: FloatArray | None = None
        self._excess = np.zeros(self.measured.size)
        self._slope = np.zeros((self.measured.size, 0))
        if self.before is not None:
            expected = self.before.expected_for(self.runs[0].readings.ids)
            self._asked_at, self._excess = expected.parameters, expected.excess
            self._slope = expected.slope
        self.parameters = np.empty(0)
        self.covariance = np.empty((0, 0))
        self.fitted = np.empty(0)
        self.calls = 0

    @property
    def excess(self) -> RodExcess | None:
        """The rod's last excess of one run; None before its first call, and of several runs."""
        if self.calls == 0 or self._asked_at is None or len(self.runs) > 1:
            return None
        return RodExcess(
            parameters=self._asked_at,
            ids=self.runs[0].readings.ids,
            excess=self._excess,
            slope=self._slope,
        )

    def run(self, start: FloatArray, scatter: float) -> None:
        """Search from parameters until a step is small against the standard error.

        Args:
            start: Parameters to begin with, shape (p,).
            scatter: Relative standard deviation of each marker by itself.

        Raises:
            IdentificationError: The parameters are unobservable, or the search does not
                come to rest.
        """
        # A node imports them before it is active, see `load_search`.
        from scipy.linalg import block_diag, solve_triangular  # noqa: PLC0415
        from scipy.optimize import least_squares  # noqa: PLC0415

        runs, config = self.runs, self.config
        angle = angle_covariance(runs, config.model_share, scatter)
        axial = axial_covariance(runs, config.model_z)
        whiten = np.linalg.cholesky(block_diag(angle, axial))

        def distance(p: FloatArray) -> FloatArray:
            left = self._corrected(p) - self.measured
            return np.asarray(solve_triangular(whiten, left, lower=True))

        p = start
        for attempt in range(config.max_calls + 1):
            found = least_squares(distance, p, bounds=self.bounds, diff_step=1.0e-4, xtol=1.0e-10)
            self.covariance = _inverse(found.jac.T @ found.jac)
            step, p = np.abs(found.x - p), found.x
            self._refuse_blind(p)
            known = attempt > 0 or self.calls > 0
            if known and np.all(step <= config.tolerance * np.sqrt(np.diag(self.covariance))):
                break
            if attempt == config.max_calls:
                raise IdentificationError(
                    f"the search did not come to rest within {config.max_calls} calls of the rod"
                )
            self._ask_rod(p)
        self.parameters, self.fitted = p, self._corrected(p)

    def _refuse_blind(self, p: FloatArray) -> None:
        error = float(np.sqrt(self.covariance[0, 0]))
        if error > _BLIND:
            raise IdentificationError(
                f"the markers lie where every cable of about {self.family(p).young / 1e6:.3g} MPa "
                f"or stiffer would lie (standard error {error:.0%}, limit {_BLIND:.0%}): it is "
                "stretched too little to tell its modulus"
            )

    def _closed(self, p: FloatArray) -> FloatArray:
        return _in_order([lay(run, self.family(p)) for run in self.runs])

    def _corrected(self, p: FloatArray) -> FloatArray:
        excess = self._excess
        if self._asked_at is not None:
            excess = excess + self._slope @ (p - self._asked_at)
        closed = self._closed(p)
        return np.asarray(closed + np.where(self._angles, closed, 1.0) * excess)

    def _ask_rod(self, p: FloatArray) -> None:
        law = self.family(p)
        places = [lay(run, law) for run in self.runs]
        expected = _in_order(places)
        exact = _in_order(
            [
                wind(run, law, theta, self.going)
                for run, (theta, _) in zip(self.runs, places, strict=True)
            ]
        )
        # Relative for angles, which differ by a share; absolute for z.
        excess = (exact - expected) / np.where(self._angles, expected, 1.0)
        if self._asked_at is None:
            self._slope = np.zeros((expected.size, p.size))
        else:
            way = p - self._asked_at
            if float(way @ way) > _SHORTEST**2:
                missed = excess - self._excess - self._slope @ way
                self._slope = self._slope + np.outer(missed, way) / float(way @ way)
        self._asked_at, self._excess = p, excess
        self.calls += 1


def _inverse(information: FloatArray) -> FloatArray:
    eigen, vectors = np.linalg.eigh(information)
    # A direction that nothing is known of gets a variance that is huge and finite.
    return np.asarray(vectors / np.maximum(eigen, 1.0e-8) @ vectors.T)


def _in_order(places: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return the angles of all runs and then the z of all runs."""
    return np.concatenate([*(theta for theta, _ in places), *(z for _, z in places)])
