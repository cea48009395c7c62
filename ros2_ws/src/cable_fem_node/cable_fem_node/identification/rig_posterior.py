"""Joint posterior of the rig that wound tracked markers, with the markers to come."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.modulus import WORST_SHARE
from cable_fem_node.identification.rig import DERIVED, Numbers, Unknown
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_part import RigPart
from cable_fem_node.identification.rig_search import DRAWS, RigSearch
from cable_fem_node.identification.search import FitConfig
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from cable_fem_node.winding.rig_prior import RigPrior

_OBSERVED = 0.8  # A number whose deviation stays above this share of the prior's is unobservable
_MOST_SCATTER = 0.05  # Scatter beyond which markers are not those of any rig [m]
# Scatter is found to within this factor.
_SCATTER_STEP = 1.05
_PRIOR_DRAWS = 4000


@dataclass(frozen=True, kw_only=True)
class MarkerAhead:
    """A marker that was not used."""

    id: int  # n of Pn
    theta: float  # Wound angle [rad]
    sigma_theta: float  # One standard deviation [rad]
    z: float  # Axial position [m]
    sigma_z: float  # [m]
    s: float  # Curve length [m]
    low: float  # 5 % lie below this s [m]
    high: float  # 5 % lie above [m]

    @property
    def half_width_90(self) -> float:
        """Half of the 90 % interval of s [m]."""
        return 0.5 * (self.high - self.low)


def markers_ahead(
    part: RigPart, theta: FloatArray, z: FloatArray, weights: FloatArray
) -> tuple[MarkerAhead, ...]:
    """Return the markers of a run that were not used.

    What the used markers miss is carried on by the covariance of model and machine: an offset
    of P0 shifts all of them.

    Args:
        part: The run.
        theta: Of all markers on each drawn rig [rad], shape (n, m).
        z: [m], shape (n, m).
        weights: Sum one, shape (n,).
    """
    count = part.lay.arc.size
    unused = np.setdiff1d(np.arange(count), part.used)
    if unused.size == 0:
        return ()
    rng = np.random.default_rng(1)
    theta, z = (
        _carried(part, name, laid, unused, rng) for name, laid in (("theta", theta), ("z", z))
    )
    s = np.hypot(part.run.config.case.centreline_radius * theta, z)
    rows = []
    for column, marker in enumerate(unused.tolist()):
        low, high = interval_of(s[:, column], weights)
        means = [float(weights @ values[:, column]) for values in (theta, z, s)]
        spreads = [
            float(np.sqrt(weights @ (values[:, column] - mean) ** 2))
            for values, mean in zip((theta, z), means, strict=False)
        ]
        rows.append(
            MarkerAhead(
                id=marker + 1,
                theta=means[0],
                sigma_theta=spreads[0],
                z=means[1],
                sigma_z=spreads[1],
                s=means[2],
                low=low,
                high=high,
            )
        )
    return tuple(rows)


def _carried(
    part: RigPart,
    name: str,
    laid: FloatArray,
    unused: NDArray[np.intp],
    rng: np.random.Generator,
) -> FloatArray:
    """Return one draw of theta or z of the unused markers for each rig, shape (n, u)."""
    used, deviations = part.used, getattr(part.deviations, name)
    measured = getattr(part.run.readings, name)
    sigma = getattr(part.run.readings, f"sigma_{name}")
    seen = deviations[np.ix_(used, used)] + np.diag(sigma**2)
    across = deviations[np.ix_(unused, used)]
    gain = np.linalg.solve(seen, across.T).T
    left = deviations[np.ix_(unused, unused)] - gain @ across.T
    # Rounding may leave an eigenvalue a little below zero.
    size, way = np.linalg.eigh(left)
    noise = rng.standard_normal((laid.shape[0], unused.size)) * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(laid[:, unused] + (measured - laid[:, used]) @ gain.T + noise @ way.T)


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


@dataclass(frozen=True, kw_only=True)
class Belief:
    """One number of the rig, before and after."""

    name: str  # As in every table of numbers
    words: str  # What it is, with its printed unit
    unit: float  # One of these in SI
    mean: float  # Posterior mean
    deviation: float  # Posterior standard deviation
    low: float  # 5 % of the posterior lie below
    high: float  # 5 % lie above
    prior_deviation: float  # Standard deviation before, 0 of what was known
    prior_low: float  # 5 % of the prior lie below
    prior_high: float  # 5 % lie above

    @classmethod
    def of(
        cls, item: Unknown, values: FloatArray, weights: FloatArray, before: FloatArray
    ) -> Belief:
        """Return the belief of draws, shape (n,), with weights of sum one, and of prior draws."""
        values = np.broadcast_to(values, weights.shape)
        mean = float(weights @ values)
        low, high = interval_of(values, weights)
        prior_low, prior_high = np.quantile(before, [0.05, 0.95])
        # What was known leaves rounding errors.
        spread = float(before.std())
        known = spread < 1.0e-12 * max(abs(mean), 1.0)
        return Belief(
            name=item.name,
            words=item.words,
            unit=item.unit,
            mean=mean,
            deviation=0.0 if known else math.sqrt(float(weights @ (values - mean) ** 2)),
            low=low,
            high=high,
            prior_deviation=0.0 if known else spread,
            prior_low=float(prior_low),
            prior_high=float(prior_high),
        )

    @property
    def half_width_90(self) -> float:
        """Half of the 90 % interval."""
        return 0.5 * (self.high - self.low)

    @property
    def observed(self) -> bool:
        """Whether the markers narrow the prior."""
        return self.deviation < _OBSERVED * self.prior_deviation


@dataclass(frozen=True, kw_only=True)
class RigPosterior:
    """The rigs that explain the markers."""

    rigs: Numbers  # Draws
    weights: FloatArray  # Of the draws, sum one, shape (n,)
    # By name: every number that is looked for, and the combinations of `DERIVED`:
    # ``effective_young`` [Pa] is the modulus with which the stated tension alone would stretch the
    # used length as much.
    beliefs: dict[str, Belief]
    best: Numbers  # Of the rig with the greatest evidence, shape (1,) each
    deviates: FloatArray  # Of the prior there, of the open numbers, shape (k,)
    spread: FloatArray  # Covariance of these deviates, shape (k, k)
    steady: float  # Probability that the tension does not build up
    chi_square: float  # Sum of squares of the best rig, prior included
    measured: int  # How many numbers were measured
    misfit: bool  # Whether the markers contradict model and tracker
    scatter: float  # Deviation of every marker's place that was added for that [m]
    evidence: float  # ln of the density of the measurements
    # Greatest residual of an angle relative to the angle, at the mean prediction.
    worst_share: float
    ahead: tuple[tuple[MarkerAhead, ...], ...]  # Markers that were not used, by run

    @property
    def names(self) -> tuple[str, ...]:
        """What `covariance` and `correlation` are of, in order: what was looked for."""
        combined = {item.name for item in DERIVED}
        return tuple(item.name for item in self.found if item.name not in combined)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of `names`, shape (k, k)."""
        return covariance_of(
            np.column_stack([self.rigs[name] for name in self.names]), self.weights
        )

    @property
    def correlation(self) -> FloatArray:
        """Correlations of `names`, shape (k, k)."""
        covariance = self.covariance
        scale = np.sqrt(np.diag(covariance))
        return np.asarray(covariance / np.outer(scale, scale))

    @property
    def found(self) -> tuple[Belief, ...]:
        """What was not known before."""
        return tuple(item for item in self.beliefs.values() if item.prior_deviation > 0.0)

    @property
    def unobservable(self) -> tuple[str, ...]:
        """Numbers that were neither known before nor narrowed by the markers."""
        return tuple(item.name for item in self.found if not item.observed)

    def remarks(self) -> Iterator[str]:
        """Yield what the markers leave open, and whether they contradict the model."""
        left = [item.words.split(",")[0] for item in self.found if not item.observed]
        if left:
            yield f"unobservable, so that the prior remains: {', '.join(left)}"
        if self.misfit:
            yield (
                f"the markers contradict model and tracker (sum of squares {self.chi_square:.3g} "
                f"of {self.measured} numbers): each was given a scatter of "
                f"{1.0e3 * self.scatter:.2g} mm, which the widths include"
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
    runs: Sequence[TrackedRun], prior: RigPrior | None = None, *, draws: int = DRAWS
) -> RigPosterior:
    """Return the joint posterior of the rig that wound one cable.

    Where the markers contradict model and tracker (chance below 1 %), their places get a scatter
    of their own, as large as brings the sum of squares to its expectation (Mandel and Paule, J.
    Res. Natl. Bur. Stand. 87, 1982).

    Args:
        runs: Of one cable on one rig, at least one; two weights separate drag from share.
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
    lays = [RigLay.of(run) for run in runs]
    search = RigSearch(runs, prior, lays)
    if any(run.commanded is not None for run in runs):
        search = search.with_rod()
    squares, evidence = search.chi_square, search.evidence
    misfit = float(chdtrc(search.measured, squares)) < FitConfig.misfit_level
    scatter = 0.0
    if misfit:
        scatter, search = _scattered(runs, prior, lays, search)
    sample, steady, weights = search.draw(draws)
    coordinates = search.coordinates
    rigs = coordinates.numbers(sample, steady)
    every = coordinates.with_derived(rigs)
    rng = np.random.default_rng(0)
    before = coordinates.with_derived(coordinates.drawn(rng, _PRIOR_DRAWS, prior.steady))
    laid = [(part, part.lay(rigs)) for part in search.parts]
    return RigPosterior(
        rigs=rigs,
        weights=weights,
        beliefs={
            item.name: Belief.of(item, every[item.name], weights, before[item.name])
            for item in (*coordinates.unknowns, *DERIVED)
            if item.asked
        },
        best=search.best,
        deviates=coordinates.deviates(*search.place)[0],
        spread=covariance_of(coordinates.deviates(sample, steady), weights),
        steady=float(weights[steady].sum()),
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
    runs: Sequence[TrackedRun], prior: RigPrior, lays: Sequence[RigLay], before: RigSearch
) -> tuple[float, RigSearch]:
    """Return the scatter [m] at which the sum of squares is as expected, and the search with it."""

    def with_scatter(scatter: float) -> RigSearch:
        wider = dataclasses.replace(
            prior,
            scatter=math.hypot(prior.scatter, scatter),
            fixing=math.hypot(prior.fixing, scatter),
        )
        return RigSearch(runs, wider, lays, before, before.excess)

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
