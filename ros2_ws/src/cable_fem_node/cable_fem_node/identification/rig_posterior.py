"""What tracked markers tell of the rig that wound them, all at once and with its covariance."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.identification.failure import IdentificationError
from cable_fem_node.identification.modulus import WORST_SHARE
from cable_fem_node.identification.rig import NAMES, RigPrior, Rigs
from cable_fem_node.identification.rig_ahead import MarkerAhead, markers_ahead
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_search import RigSearch
from cable_fem_node.identification.search import FitConfig
from cable_fem_node.identification.tracked_run import TrackedRun
from cable_fem_node.identification.weighted import covariance_of, interval_of

# As many as a 5 % quantile needs to be known to a twentieth of the interval.
DRAWS = 600
# A deviation that has not shrunk below this share of the prior's was not told by the markers.
_TOLD = 0.8
# Scatter beyond which markers are not those of any rig [m].
_MOST_SCATTER = 0.05
# Scatter is found to within this factor.
_SCATTER_STEP = 1.05
# With fewer draws that count than this share of them, five times as many are drawn.
_FEWEST = 0.15


@dataclass(frozen=True, kw_only=True)
class Belief:
    """One number of the rig, before and after.

    Attributes:
        mean: Posterior mean.
        deviation: Posterior standard deviation.
        low: 5 % of the posterior lie below.
        high: 5 % lie above.
        prior_deviation: Standard deviation before.
    """

    mean: float
    deviation: float
    low: float
    high: float
    prior_deviation: float

    @property
    def half_width_90(self) -> float:
        """Half of the 90 % interval."""
        return 0.5 * (self.high - self.low)

    @property
    def told(self) -> bool:
        """Whether the markers told more than was known before."""
        return self.deviation < _TOLD * self.prior_deviation


@dataclass(frozen=True, kw_only=True)
class RigPosterior:
    """The rigs that explain the markers.

    Attributes:
        rigs: Draws.
        weights: Of the draws, sum one, shape (n,).
        beliefs: By name: E, free length, load share, drag, start share, build-up length in the
            units of `Rigs`, and ``effective_young`` [Pa], the modulus with which the stated
            tension alone would stretch the used length as much.
        mean: Of NAMES, shape (6,).
        covariance: Of NAMES, shape (6, 6).
        steady: Probability that the tension does not build up.
        chi_square: Sum of squares of the best rig, prior included.
        measured: How many numbers were measured.
        misfit: Whether the markers contradict model and tracker.
        scatter: Deviation of every marker's place that was added for that [m].
        evidence: ln of the density of the measurements.
        worst_share: Greatest residual of an angle relative to the angle, at the mean prediction.
        ahead: Markers that were not used, by run.
    """

    rigs: Rigs
    weights: FloatArray
    beliefs: dict[str, Belief]
    mean: FloatArray
    covariance: FloatArray
    steady: float
    chi_square: float
    measured: int
    misfit: bool
    scatter: float
    evidence: float
    worst_share: float
    ahead: tuple[tuple[MarkerAhead, ...], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """What `mean`, `covariance` and `correlation` are of, in order."""
        return NAMES

    @property
    def correlation(self) -> FloatArray:
        """Correlations of NAMES, shape (6, 6); zero where a number was known before."""
        deviation = np.sqrt(np.diag(self.covariance))
        scale = np.where(deviation > 0.0, deviation, np.inf)
        return np.asarray(self.covariance / np.outer(scale, scale))

    @property
    def untold(self) -> tuple[str, ...]:
        """Numbers that were not known and of which the markers tell nothing."""
        return tuple(
            name
            for name in NAMES
            if self.beliefs[name].prior_deviation > 0.0 and not self.beliefs[name].told
        )

    def refusal(self) -> str:
        """Return why the posterior must not be used; empty where nothing speaks against it."""
        if self.worst_share > WORST_SHARE:
            return (
                f"the best rig misses a marker by {self.worst_share:.1%} of its angle "
                f"(limit {WORST_SHARE:.0%})"
            )
        for run in self.ahead:
            for marker in run:
                if marker.half_width_90 > WORST_SHARE * marker.s:
                    return (
                        f"the length of P{marker.id} is known to "
                        f"{marker.half_width_90 / marker.s:.1%} only (limit {WORST_SHARE:.0%})"
                    )
        return ""


def identify_rig(
    runs: Sequence[TrackedRun],
    prior: RigPrior | None = None,
    *,
    draws: int = DRAWS,
) -> RigPosterior:
    """Return the joint posterior of the rig that wound one cable.

    Where the markers contradict model and tracker (chance below 1 %), their places get a scatter
    of their own, as large as brings the sum of squares to its expectation (Mandel and Paule, J.
    Res. Natl. Bur. Stand. 87, 1982).

    Args:
        runs: Of one cable on one rig, at least one; two weights tell drag from share.
        prior: What was known before.
        draws: How many rigs are drawn.

    Raises:
        IdentificationError: No run was given, or the runs are not of one cable.
    """
    from scipy.special import chdtrc  # noqa: PLC0415 - live, beside the machine

    if not runs:
        raise IdentificationError("identification needs at least one run, got none")
    _refuse_different(runs)
    prior = RigPrior() if prior is None else prior
    lays = [RigLay(run) for run in runs]
    search = RigSearch(runs, prior, lays)
    squares, evidence = search.chi_square, search.evidence
    misfit = float(chdtrc(search.measured, squares)) < FitConfig.misfit_level
    scatter = 0.0
    if misfit:
        scatter, search = _scattered(runs, prior, lays)
    rigs, weights = search.draw(draws)
    if 1.0 / float(weights @ weights) < _FEWEST * draws:
        rigs, weights = search.draw(5 * draws)
    table = rigs.table()
    every = dict(zip(NAMES, table.T, strict=True))
    every["effective_young"] = search.coordinates.effective_young(rigs)
    known = _known_before(search)
    # What was known has no covariance, not even that of rounding.
    open_ = np.array([known[name] > 0.0 for name in NAMES])
    places = [part.lay(rigs) for part in search.parts]
    laid = list(zip(search.parts, places, strict=True))
    return RigPosterior(
        rigs=rigs,
        weights=weights,
        beliefs={name: _belief(values, weights, known[name]) for name, values in every.items()},
        mean=weights @ table,
        covariance=covariance_of(table, weights) * np.outer(open_, open_),
        steady=float(weights[rigs.start_share == 1.0].sum()),
        chi_square=squares,
        measured=search.measured,
        misfit=misfit,
        scatter=scatter,
        evidence=evidence,
        worst_share=max(part.worst_share(theta, weights) for part, (theta, _) in laid),
        ahead=tuple(markers_ahead(part, *place, weights) for part, place in laid),
    )


def _refuse_different(runs: Sequence[TrackedRun]) -> None:
    first = runs[0].config
    for run in runs[1:]:
        if run.config.law != first.law or run.config.case.material != first.case.material:
            raise IdentificationError("all runs must be of one cable with one law")
        if run.config.case.section_area != first.case.section_area:
            raise IdentificationError(
                f"all runs must be of one cable, got diameters of "
                f"{first.case.cable_diameter:g} and {run.config.case.cable_diameter:g} m"
            )


def _scattered(
    runs: Sequence[TrackedRun], prior: RigPrior, lays: Sequence[RigLay]
) -> tuple[float, RigSearch]:
    """Return the scatter [m] at which the sum of squares is as expected, and the search with it."""

    def with_scatter(scatter: float) -> RigSearch:
        wider = dataclasses.replace(
            prior,
            scatter=math.hypot(prior.scatter, scatter),
            fixing=math.hypot(prior.fixing, scatter),
        )
        return RigSearch(runs, wider, lays)

    low, high = 1.0e-5, _MOST_SCATTER
    found = with_scatter(high)
    while high > _SCATTER_STEP * low:
        middle = math.sqrt(low * high)
        search = with_scatter(middle)
        if search.chi_square > search.measured:
            low = middle
        else:
            high, found = middle, search
    return high, found


def _known_before(search: RigSearch) -> dict[str, float]:
    """Return the standard deviations before a marker has landed."""
    rng = np.random.default_rng(0)
    count = 4000
    prior, coordinates = search.prior, search.coordinates
    low, high = np.log(prior.build_up_length)
    q = rng.standard_normal((count, 5))
    rigs = coordinates.rigs(
        q, np.exp(rng.uniform(low, high, count)), rng.random(count) < prior.steady
    )
    young = coordinates.young * np.exp(prior.young_deviation * rng.standard_normal(count))
    rigs = dataclasses.replace(rigs, young=young)
    known = {name: float(getattr(rigs, name).std()) for name in NAMES}
    known["effective_young"] = float(coordinates.effective_young(rigs).std())
    # A range of no width leaves rounding errors.
    return {name: value if value > 1.0e-12 else 0.0 for name, value in known.items()}


def _belief(values: FloatArray, weights: FloatArray, before: float) -> Belief:
    mean = float(weights @ values)
    low, high = interval_of(values, weights)
    return Belief(
        mean=mean,
        deviation=math.sqrt(float(weights @ (values - mean) ** 2)) if before else 0.0,
        low=low,
        high=high,
        prior_deviation=before,
    )
